// node read_bags.mjs BIN DIR: writes a drive in every form of bag that people have, and compares what `cairn` and
// `cairn-offline` read with what was written: numbers of scans, stamps, mountings, and every point that a beam has hit.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import fs from "node:fs";
import path from "node:path";
import { folder, mcap, packZstd, sqlite } from "./bags.mjs";
import { LIDARS, makeDrive, mountingOf, trajectory } from "./drive.mjs";

const [bin, out] = process.argv.slice(2);
fs.rmSync(out, { recursive: true, force: true });
fs.mkdirSync(out, { recursive: true });
const save = (name, bytes) => {
  fs.writeFileSync(path.join(out, name), bytes);
  return path.join(out, name);
};
const run = (program, ...words) => {
  const done = spawnSync(path.join(bin, program), words, { encoding: "utf8" });
  if (done.status !== 0) throw new Error(`${program} ${words.join(" ")}: ${done.status}\n${done.stdout}${done.stderr}`);
  return done.stdout;
};
const refusal = (...words) => {
  const done = spawnSync(path.join(bin, "cairn"), words, { encoding: "utf8" });
  assert.equal(done.status, 1, `${words.join(" ")} was not refused`);
  return done.stderr;
};

const tum = save("path.tum", trajectory());
let checks = 0;
const check = (form, file, drive, lidars) => {
  const reports = run("cairn", "check-log", file, "--json").trim().split("\n").map((line) => JSON.parse(line));
  assert.equal(reports.length, lidars.length, `${form}: reports`);
  reports.forEach((report, i) => {
    const own = drive.scans.filter((scan) => scan.lidar === lidars[i]);
    assert.equal(report.scans.count, own.length, `${form}: scans`);
    assert.equal(report.odometry.count, 21, `${form}: odometry`);
    assert.equal(report.complaint_count, 0, `${form}: ${report.complaints}`);
    assert.deepEqual(report.refused, {}, form);
    assert.ok(Math.abs(report.scans.duration_s - 1.9) < 1e-9, `${form}: ${report.scans.duration_s} s`);
    assert.ok(Math.abs(report.way_m - 1.0) < 1e-6, `${form}: a way of ${report.way_m} m`);
    assert.equal(report.range_max_m, 12, form);
    const mounting = mountingOf(lidars[i]);
    assert.ok(Math.abs(report.T_robot_laser.x - mounting.x) < 1e-6 && Math.abs(report.T_robot_laser.y - mounting.y) < 1e-6, form);
    assert.ok(Math.abs(Math.sin(report.T_robot_laser.theta - mounting.yaw)) < 1e-6, form);
  });
  // Points, in the order of the scans: where the stamps are wrong, they are elsewhere.
  const ply = path.join(out, "points.ply");
  run("cairn", "cloud", "export", file, "--trajectory", tum, "--text", "-o", ply);
  const points = fs.readFileSync(ply, "utf8").split("end_header\n")[1].trim().split("\n").map((line) => line.split(" ").map(Number));
  const expected = drive.scans.flatMap((scan) => scan.points);
  assert.equal(points.length, expected.length, `${form}: points`);
  points.forEach(([x, y], i) => {
    const far = Math.hypot(x - expected[i][0], y - expected[i][1]);
    assert.ok(far < 1e-4, `${form}: point ${i} is ${far} m away`);
  });
  const offline = JSON.parse(run("cairn-offline", file, "--json"));
  assert.equal(offline.scans_used, drive.scans.length, `${form}: cairn-offline`);
  checks += 1;
  console.log(`ok  ${form}`);
};

const one = makeDrive(LIDARS.slice(0, 1));
const front = LIDARS.slice(0, 1);
for (const compression of ["", "zstd", "lz4"]) {
  for (const chunks of [true, false]) {
    if (!chunks && compression) continue;
    for (const summary of [true, false]) {
      const form = `MCAP, ${chunks ? `chunks${compression && ` of ${compression}`}` : "no chunks"}, ${summary ? "with" : "without"} summary`;
      check(form, save("one.mcap", await mcap(one.messages, { compression, chunks, summary })), one, front);
    }
  }
}
const late = [...one.messages].sort((a, b) => (a.topic < b.topic ? -1 : 1));
check("MCAP, written topic by topic", save("topics.mcap", await mcap(late, { compression: "zstd" })), one, front);
const whole = await mcap(one.messages, { compression: "lz4", chunkSize: 1 << 20 });
check("MCAP in one chunk", save("chunk.mcap", whole), one, front);
const unchunked = await mcap(one.messages, { chunks: false, summary: false });
check("MCAP whose end is missing", save("cut.mcap", unchunked.subarray(0, unchunked.length - 1100)), one, front);
check("odometry from transforms", save("tf.mcap", await mcap(makeDrive(front, { odometry: false }).messages)), one, front);

for (const release of ["humble", "jazzy"]) {
  for (const storage of ["sqlite3", "mcap"]) {
    for (const split of [1, 3]) {
      for (const compression of ["", "message", "file"]) {
        const name = `${release}_${storage}_${split}${compression && `_${compression}`}`;
        check(`folder ${name}`, await folder(path.join(out, name), one.messages, { release, storage, split, compression }), one, front);
      }
    }
  }
  check(`one file .db3 of ${release}`, save(`${release}.db3`, sqlite(one.messages, { release })), one, front);
}
const beside = path.join(out, "resilient");
await folder(beside, one.messages, { release: "jazzy", storage: "sqlite3" });
fs.writeFileSync(path.join(beside, "resilient_0.db3"), sqlite(one.messages, { release: "jazzy", log: true }));
check("folder with a database that has a log of its own", beside, one, front);
assert.deepEqual(fs.readdirSync(beside).sort(), ["metadata.yaml", "resilient_0.db3"], "nothing is left beside the bag");
check("the same, packed", save("resilient.db3.zstd", packZstd(sqlite(one.messages, { release: "jazzy", log: true }))), one, front);

const two = makeDrive(LIDARS);
check("two lidars, MCAP", save("two.mcap", await mcap(two.messages, { compression: "zstd" })), two, LIDARS);
check("two lidars, folder", await folder(path.join(out, "two"), two.messages, { release: "humble", storage: "sqlite3", split: 2 }), two, LIDARS);
const filtered = one.messages.flatMap((message) => (message.topic === "/scan" ? [message, { ...message, topic: "/scan_filtered" }] : [message]));
assert.match(refusal("check-log", save("filtered.mcap", await mcap(filtered))), /\/scan and \/scan_filtered are of one lidar.*--scan-topic/);
assert.match(refusal("check-log", save("none.mcap", await mcap(one.messages.filter((m) => m.topic !== "/scan")))), /no topic of type .*\/odom/);
console.log(`${checks} forms of bags are read as they were written`);
