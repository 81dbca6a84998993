// A drive of a robot with two lidars as messages of ROS 2, put into bytes by Foxglove's libraries, and where each beam
// of it has hit something, computed here.
import { stringify } from "@foxglove/rosmsg";
import common from "@foxglove/rosmsg-msgs-common";
import serialization from "@foxglove/rosmsg2-serialization";

const START = 1_700_000_000n * 1_000_000_000n;
const STEPS = 20;
export const LIDARS = [
  { topic: "/scan", frame: "front_laser", parent: "mast", x: 0.15, y: 0.1, yaw: 0.3, after: 0n },
  { topic: "/rear/scan", frame: "rear_laser", parent: "base_link", x: -0.3, y: 0, yaw: Math.PI, after: 30_000_000n },
];
const MAST = { x: 0.05, y: 0, yaw: 0 };

// "sensor_msgs/LaserScan" as ROS 2 calls it, and the text of its definition as recorders store it.
export const typeOf = (name) => name.replace("/", "/msg/");
const release = common.ros2humble;
const parts = (name, seen = new Map()) => {
  if (seen.has(name)) return seen;
  seen.set(name, release[name]);
  for (const field of release[name].definitions) if (field.isComplex) parts(field.type, seen);
  return seen;
};
export const definitionOf = (name) => stringify([...parts(name).values()]);
const writers = new Map();
const encode = (name, message) => {
  if (!writers.has(name)) {
    const [first, ...rest] = parts(name).values();
    writers.set(name, new serialization.MessageWriter([{ ...first, name: undefined }, ...rest]));
  }
  return writers.get(name).writeMessage(message);
};

const time = (stamp) => ({ sec: Number(stamp / 1_000_000_000n), nanosec: Number(stamp % 1_000_000_000n) });
const turn = (yaw) => ({ x: 0, y: 0, z: Math.sin(yaw / 2), w: Math.cos(yaw / 2) });
const link = (stamp, parent, child, at) => ({
  header: { stamp: time(stamp), frame_id: parent },
  child_frame_id: child,
  transform: { translation: { x: at.x, y: at.y, z: 0.2 }, rotation: turn(at.yaw) },
});
const compose = (a, b) => ({
  x: a.x + Math.cos(a.yaw) * b.x - Math.sin(a.yaw) * b.y,
  y: a.y + Math.sin(a.yaw) * b.x + Math.cos(a.yaw) * b.y,
  yaw: a.yaw + b.yaw,
});
const poseAt = (seconds) => ({ x: 0.5 * seconds, y: 0.2, yaw: 0 });

export const mountingOf = (lidar) => (lidar.parent === "mast" ? compose(MAST, lidar) : lidar);

// Messages {topic, name, time, data} in the order of their times; scans are {stamp, lidar, points}.
export const makeDrive = (lidars, { odometry = true } = {}) => {
  const messages = [];
  const scans = [];
  const add = (topic, name, stamp, message) =>
    messages.push({ topic, name, time: stamp + 2_000_000n, data: encode(name, message) });
  add("/tf_static", "tf2_msgs/TFMessage", START, {
    transforms: [
      link(START, "base_link", "mast", MAST),
      ...LIDARS.map((lidar) => link(START, lidar.parent, lidar.frame, lidar)),
    ],
  });
  add("/parameters", "std_msgs/String", START, { data: "something else" });
  for (let step = 0; step <= STEPS; ++step) {
    const stamp = START + BigInt(step) * 100_000_000n;
    const pose = poseAt(step / 10);
    if (odometry) {
      add("/odom", "nav_msgs/Odometry", stamp, {
        header: { stamp: time(stamp), frame_id: "odom" },
        child_frame_id: "base_link",
        pose: { pose: { position: { x: pose.x, y: pose.y, z: 0 }, orientation: turn(pose.yaw) }, covariance: Array(36).fill(0) },
        twist: { twist: {}, covariance: Array(36).fill(0) },
      });
    }
    add("/tf", "tf2_msgs/TFMessage", stamp, { transforms: [link(stamp, "odom", "base_link", pose)] });
    if (step === STEPS) break;
    for (const lidar of lidars) {
      const at = stamp + lidar.after;
      const scan = {
        header: { stamp: time(at), frame_id: lidar.frame },
        angle_min: -1.5, angle_max: 1.5, angle_increment: 0.015625, time_increment: 0, scan_time: 0.1,
        range_min: 0.25, range_max: 12, ranges: [], intensities: [],
      };
      const T = compose(poseAt(Number(at - START) / 1e9), mountingOf(lidar));
      const points = [];
      for (let beam = 0; beam < 193; ++beam) {
        const range = beam % 7 === 0 ? Infinity : beam % 11 === 0 ? NaN : beam % 13 === 0 ? 0.1 : beam % 17 === 0 ? 20 : 1 + beam / 64 + step / 128;
        scan.ranges.push(range);
        scan.intensities.push(beam);
        if (!(range >= 0.25 && range < 12)) continue;
        const angle = T.yaw - 1.5 + beam * 0.015625;
        points.push([T.x + range * Math.cos(angle), T.y + range * Math.sin(angle)]);
      }
      scans.push({ stamp: at, lidar, points });
      add(lidar.topic, "sensor_msgs/LaserScan", at, scan);
    }
  }
  messages.sort((a, b) => (a.time < b.time ? -1 : a.time > b.time ? 1 : 0));
  scans.sort((a, b) => (a.stamp < b.stamp ? -1 : 1));
  return { messages, scans };
};

// The path as a trajectory of TUM: before, between and behind all scans.
export const trajectory = () => {
  let text = "";
  for (let step = -1; step <= STEPS + 1; ++step) {
    const stamp = START + BigInt(step) * 100_000_000n;
    const pose = poseAt(step / 10);
    const seconds = `${stamp / 1_000_000_000n}.${String(stamp % 1_000_000_000n).padStart(9, "0")}`;
    text += `${seconds} ${pose.x} ${pose.y} 0 0 0 ${Math.sin(pose.yaw / 2)} ${Math.cos(pose.yaw / 2)}\n`;
  }
  return text;
};
