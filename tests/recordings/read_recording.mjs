// node read_recording.mjs BIN FILE: reads what `cairn record` has written with the library of MCAP's makers, by the
// index and from the beginning to the end, checks every checksum, and decodes all messages twice: by the descriptors in
// the file, and by Foxglove's own schemas. The scans are compared with what `cairn check-log` reads from the file.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import fs from "node:fs";
import path from "node:path";
import { crc32 } from "@foxglove/crc";
import foxglove from "@foxglove/schemas/internal.js";
import zstd from "@foxglove/wasm-zstd";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";

const [bin, file] = process.argv.slice(2);
await zstd.isLoaded;
const bytes = fs.readFileSync(file);
const decompressHandlers = { zstd: (data, size) => zstd.decompress(data, Number(size)) };
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, size) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + size))),
};
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
assert.ok(reader.statistics && reader.chunkIndexes.length > 0, "there is a summary");
assert.equal(reader.statistics.chunkCount, reader.chunkIndexes.length);
assert.equal(reader.statistics.channelCount, reader.channelsById.size);
assert.equal(reader.statistics.schemaCount, reader.schemasById.size);
assert.ok(reader.summaryOffsetsByOpcode.size > 0, "there are summary offsets");
for (const chunk of reader.chunkIndexes) assert.equal(chunk.compression, "zstd");

// Foxglove's own schemas, with everything that they import.
const official = new protobuf.Root();
const google = `syntax = "proto3"; package google.protobuf;
  message Timestamp { int64 seconds = 1; int32 nanos = 2; } message Duration { int64 seconds = 1; int32 nanos = 2; }`;
protobuf.parse(google, official, { keepCase: true });
for (const schema of Object.values(foxglove.foxgloveMessageSchemas)) {
  const enums = Object.values(foxglove.foxgloveEnumSchemas).filter((one) => one.parentSchemaName === schema.name);
  protobuf.parse(foxglove.generateProto(schema, enums), official, { keepCase: true });
}
official.resolveAll();

const decoders = new Map();
for (const schema of reader.schemasById.values()) {
  assert.equal(schema.encoding, "protobuf");
  const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(schema.data));
  root.resolveAll();
  const own = root.lookupType(schema.name);
  const theirs = schema.name.startsWith("foxglove.") ? official.lookupType(schema.name) : undefined;
  for (const field of theirs ? own.fieldsArray : []) {
    const twin = Object.values(theirs.fields).find((one) => one.id === field.id);
    assert.ok(twin, `${schema.name}: Foxglove has no field ${field.id}`);
    assert.equal(twin.name, field.name.replace(/[A-Z]/g, (letter) => `_${letter.toLowerCase()}`), schema.name);
    assert.equal(twin.repeated, field.repeated, `${schema.name}.${twin.name}`);
  }
  decoders.set(schema.id, { name: schema.name, own, theirs });
}

const options = { longs: String, enums: Number, defaults: true, arrays: true };
const plain = (value) =>
  value === null || typeof value !== "object" || value instanceof Uint8Array
    ? value
    : Array.isArray(value)
      ? value.map(plain)
      : Object.fromEntries(Object.entries(value).map(([key, one]) => [key.replaceAll("_", "").toLowerCase(), plain(one)]));
const counts = new Map();
const scans = new Map();
let last = 0n;
for await (const message of reader.readMessages({ validateCrcs: true })) {
  assert.ok(message.logTime >= last, "messages are in the order of their times");
  last = message.logTime;
  counts.set(message.channelId, (counts.get(message.channelId) ?? 0n) + 1n);
  const channel = reader.channelsById.get(message.channelId);
  assert.equal(channel.messageEncoding, "protobuf");
  const { name, own, theirs } = decoders.get(channel.schemaId);
  const value = plain(own.toObject(own.decode(message.data), options));
  if (theirs) {
    const same = plain(theirs.toObject(theirs.decode(message.data), options));
    for (const [key, one] of Object.entries(value)) assert.deepEqual(same[key], one, `${name}.${key}`);
  }
  if (name !== "foxglove.LaserScan") continue;
  const seen = scans.get(channel.topic) ?? { count: 0, beams: 0, hits: 0, first: value, last: value };
  seen.count += 1;
  seen.beams += value.ranges.length;
  seen.last = value;
  scans.set(channel.topic, seen);
}
assert.deepEqual(counts, reader.statistics.channelMessageCounts, "the statistics count every message");
assert.equal([...counts.values()].reduce((a, b) => a + b, 0n), reader.statistics.messageCount);

// From the beginning to the end, as who has no index.
const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
stream.append(bytes);
let streamed = 0n, dataEnd, footer;
for (let record; (record = stream.nextRecord()); ) {
  if (record.type === "Message") streamed += 1n;
  if (record.type === "DataEnd") dataEnd = record;
  if (record.type === "Footer") footer = record;
}
assert.ok(stream.done(), "the file has an end");
assert.equal(streamed, reader.statistics.messageCount);
const dataEndAt = Number(footer.summaryStart) - 13;  // Its opcode, length and checksum.
assert.equal(bytes[dataEndAt], 0x0f);
if (dataEnd.dataSectionCrc !== 0) assert.equal(crc32(bytes.subarray(0, dataEndAt)), dataEnd.dataSectionCrc);
assert.notEqual(footer.summaryCrc, 0, "the summary has a checksum");
assert.equal(crc32(bytes.subarray(Number(footer.summaryStart), bytes.length - 8 - 4)), footer.summaryCrc);

assert.ok(scans.size > 0, "there are scans");
const nanoseconds = (time) => BigInt(time.seconds) * 1_000_000_000n + BigInt(time.nanos);
for (const [topic, seen] of scans) {
  const done = spawnSync(path.join(bin, "cairn"), ["check-log", file, "--scan-topic", topic, "--json"], { encoding: "utf8" });
  const report = JSON.parse(done.stdout);
  assert.equal(report.scans.count, seen.count, topic);
  const beams = Object.entries(report.beam_counts).reduce((sum, [size, many]) => sum + Number(size) * many, 0);
  assert.equal(beams, seen.beams, topic);
  const duration = Number(nanoseconds(seen.last.timestamp) - nanoseconds(seen.first.timestamp)) / 1e9;
  assert.ok(Math.abs(report.scans.duration_s - duration) < 1e-6, `${topic}: ${report.scans.duration_s} s, and ${duration} s`);
  assert.ok(Math.abs(report.T_robot_laser.x - seen.first.pose.position.x) < 1e-9, topic);
}
console.log(`${streamed} messages of ${reader.channelsById.size} topics in ${reader.chunkIndexes.length} chunks are as MCAP and Foxglove define them`);
