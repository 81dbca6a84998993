// The files in which ROS 2 records, written by other software than Cairn: MCAP by its makers' library, and databases of
// SQLite with the tables that rosbag2 makes.
import fs from "node:fs";
import path from "node:path";
import { McapWriter } from "@mcap/core";
import zstd from "@foxglove/wasm-zstd";
import lz4 from "lz4js";
import initSqlJs from "sql.js";
import { definitionOf, typeOf } from "./drive.mjs";

await zstd.isLoaded;
const SQL = await initSqlJs();
export const packZstd = (bytes) => new Uint8Array(zstd.compress(Buffer.from(bytes)));

class Memory {
  #parts = [];
  #size = 0n;
  async write(bytes) {
    this.#parts.push(Buffer.from(bytes));
    this.#size += BigInt(bytes.byteLength);
  }
  position() {
    return this.#size;
  }
  bytes() {
    return Buffer.concat(this.#parts);
  }
}

const compressions = {
  "": undefined,
  zstd: (data) => ({ compression: "zstd", compressedData: packZstd(data) }),
  lz4: (data) => ({ compression: "lz4", compressedData: new Uint8Array(lz4.compress(data)) }),
};

export const mcap = async (messages, { compression = "", chunks = true, summary = true, chunkSize = 8000 } = {}) => {
  const file = new Memory();
  const writer = new McapWriter({
    writable: file,
    useChunks: chunks,
    chunkSize,
    compressChunk: compressions[compression],
    useStatistics: summary,
    useSummaryOffsets: summary,
    useMessageIndex: summary,
    useChunkIndex: summary,
    useAttachmentIndex: summary,
    useMetadataIndex: summary,
    repeatSchemas: summary,
    repeatChannels: summary,
  });
  await writer.start({ profile: "ros2", library: "witness" });
  const channels = new Map();
  const counts = new Map();
  for (const message of messages) {
    if (!channels.has(message.topic)) {
      const schemaId = await writer.registerSchema({
        name: typeOf(message.name), encoding: "ros2msg", data: new TextEncoder().encode(definitionOf(message.name)),
      });
      const metadata = new Map([["offered_qos_profiles", QOS]]);
      channels.set(message.topic, await writer.registerChannel({ schemaId, topic: message.topic, messageEncoding: "cdr", metadata }));
    }
    const sequence = counts.get(message.topic) ?? 0;
    counts.set(message.topic, sequence + 1);
    await writer.addMessage({
      channelId: channels.get(message.topic), sequence, logTime: message.time, publishTime: message.time, data: message.data,
    });
  }
  await writer.addAttachment({ name: "photo", logTime: 1n, createTime: 1n, mediaType: "image/png", data: new Uint8Array(1000) });
  await writer.addMetadata({ name: "rosbag2", metadata: new Map([["serialized_metadata", "rosbag2_bagfile_information: {}"]]) });
  await writer.end();
  return file.bytes();
};

const QOS = `- history: 3
  depth: 0
  reliability: 1
  durability: 2
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false`;
const QOS_OF_JAZZY = QOS.replace("history: 3", "history: unknown").replace("reliability: 1", "reliability: reliable")
  .replace("durability: 2", "durability: volatile").replace("liveliness: 1", "liveliness: automatic");

// `release`: "humble" or "jazzy", whose tables differ. `log`: in the format with a log of its own (WAL).
export const sqlite = (messages, { release = "humble", log = false } = {}) => {
  const database = new SQL.Database();
  const jazzy = release === "jazzy";
  const hash = jazzy ? ", type_description_hash TEXT NOT NULL" : "";
  database.run(`CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL)`);
  database.run(`INSERT INTO schema VALUES (${jazzy ? 4 : 3}, '${release}')`);
  database.run(`CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL)`);
  database.run(`CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
    serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL${hash})`);
  if (jazzy) {
    database.run(`CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
      encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL)`);
  }
  database.run(`CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL)`);
  database.run(`CREATE INDEX timestamp_idx ON messages (timestamp ASC)`);
  const topics = new Map();
  for (const { topic, name } of messages) {
    if (topics.has(topic)) continue;
    topics.set(topic, topics.size + 1);
    const row = [topics.get(topic), topic, typeOf(name), "cdr", jazzy ? QOS_OF_JAZZY : QOS];
    database.run(`INSERT INTO topics VALUES (?, ?, ?, ?, ?${jazzy ? ", 'RIHS01_00'" : ""})`, row);
    if (jazzy) {
      database.run(`INSERT INTO message_definitions (topic_type, encoding, encoded_message_definition, type_description_hash)
        VALUES (?, 'ros2msg', ?, 'RIHS01_00')`, [typeOf(name), definitionOf(name)]);
    }
  }
  const insert = database.prepare(`INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)`);
  for (const message of messages) insert.run([topics.get(message.topic), message.time.toString(), message.data]);
  insert.free();
  const bytes = Buffer.from(database.export());
  database.close();
  if (log) bytes[18] = bytes[19] = 2;
  return bytes;
};

const metadata = (messages, files, { release, storage, compression = "" }) => {
  const jazzy = release === "jazzy";
  const qos = jazzy ? QOS_OF_JAZZY : QOS;
  const first = messages[0].time;
  const duration = messages.at(-1).time - first;
  const topics = new Map();
  for (const { topic, name } of messages) topics.set(topic, { name, count: (topics.get(topic)?.count ?? 0) + 1 });
  let text = `rosbag2_bagfile_information:\n  version: ${jazzy ? 9 : 5}\n  storage_identifier: ${storage}\n`;
  text += `  duration:\n    nanoseconds: ${duration}\n  starting_time:\n    nanoseconds_since_epoch: ${first}\n`;
  text += `  message_count: ${messages.length}\n  topics_with_message_count:\n`;
  for (const [topic, { name, count }] of topics) {
    text += `    - topic_metadata:\n        name: ${topic}\n        type: ${typeOf(name)}\n        serialization_format: cdr\n`;
    if (jazzy) {
      text += `        offered_qos_profiles:\n${qos.split("\n").map((line) => `          ${line}\n`).join("")}`;
      text += `        type_description_hash: RIHS01_00\n`;
    } else {
      text += `        offered_qos_profiles: "${qos.replaceAll("\n", "\\n")}"\n`;
    }
    text += `      message_count: ${count}\n`;
  }
  text += `  compression_format: "${compression ? "zstd" : ""}"\n  compression_mode: "${compression}"\n`;
  text += `  relative_file_paths:\n${files.map((file) => `    - ${file}\n`).join("")}  files:\n`;
  for (const file of files) {
    text += `    - path: ${file.replace(/\.zstd$/, "")}\n      starting_time:\n        nanoseconds_since_epoch: ${first}\n`;
    text += `      duration:\n        nanoseconds: ${duration}\n      message_count: ${messages.length}\n`;
  }
  if (jazzy) text += `  custom_data: ~\n  ros_distro: jazzy\n`;
  return text;
};

// A folder as `ros2 bag record` makes it. `compression`: "", "message" or "file".
export const folder = async (directory, messages, { release, storage, split = 1, compression = "" }) => {
  fs.mkdirSync(directory, { recursive: true });
  const name = path.basename(directory);
  const each = Math.ceil(messages.length / split);
  const files = [];
  for (let i = 0; i < split; ++i) {
    let part = messages.slice(i * each, (i + 1) * each);
    if (compression === "message") part = part.map((message) => ({ ...message, data: packZstd(message.data) }));
    let bytes = storage === "mcap" ? await mcap(part, { compression: compression ? "" : "zstd" }) : sqlite(part, { release });
    let file = `${name}_${i}.${storage === "mcap" ? "mcap" : "db3"}`;
    if (compression === "file") {
      bytes = packZstd(bytes);
      file += ".zstd";
    }
    fs.writeFileSync(path.join(directory, file), bytes);
    files.push(file);
  }
  fs.writeFileSync(path.join(directory, "metadata.yaml"), metadata(messages, files, { release, storage, compression }));
  return directory;
};
