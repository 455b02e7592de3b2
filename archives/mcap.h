// MCAP files, the container of robot logs that Foxglove's tools, PlotJuggler and others read: packed chunks of some
// megabytes with an index, so that viewers seek. What was flushed survives a writer that is killed: the chunk in work
// is read as far as it goes. Source: the MCAP specification, version 0.
#pragma once

#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

struct ZSTD_CCtx_s;

namespace duet {

struct McapChannel {
  std::uint16_t id = 0;
  std::string topic;             // "guard/tick"
  std::string message_encoding;  // "cdr", "json", ...
  // None where the name is empty.
  std::string schema_name, schema_encoding, schema;
};

// None; packed by zstd with an index, fast (a log that is written while a robot moves) or small.
enum class McapChunks { kNone, kFast, kSmall };

// One owner, one thread. A failure of write(), flush() or finish() stays; error() is the system's reason.
class McapWriter {
 public:
  // Makes `path`; throws StorageError where it is there already or cannot be made.
  explicit McapWriter(const std::string& path, McapChunks chunks = McapChunks::kNone);
  ~McapWriter();
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  // Channels have ids from 1 on, and are added before their messages.
  void add(const McapChannel& channel);
  // `time` [ns]. False where the file could not be written, now or before.
  bool write(std::uint16_t channel, std::uint32_t sequence, std::uint64_t time, std::span<const std::byte> data);
  // Everything so far reaches the file, also of a chunk in work: read_mcap() finds it there.
  bool flush();
  // The end of the data with its checksum, then the index; nothing may follow. False as above.
  bool finish();
  [[nodiscard]] bool good() const { return error_ == 0; }
  [[nodiscard]] int error() const { return error_; }  // of errno, the first; 0: none

 private:
  struct Packer {
    void operator()(ZSTD_CCtx_s* stream) const;
  };
  // A chunk's place in the file, and where in it each channel's messages begin: times [ns] and bytes.
  struct ChunkPlace {
    std::uint64_t at = 0, length = 0, first_time = 0, last_time = 0, raw = 0, packed = 0;
    std::map<std::uint16_t, std::uint64_t> indices;  // where the index of each channel stands in the file
    std::uint64_t index_length = 0;
  };
  using MessagePlaces = std::vector<std::pair<std::uint64_t, std::uint64_t>>;

  void put(std::span<const std::byte> bytes);
  void put_record(std::uint8_t kind, std::string_view content);
  // Adds to the chunk, where there are chunks.
  void gather(std::span<const std::byte> bytes);
  void gather_record(std::uint8_t kind, std::string_view content);
  void begin_chunk();
  void pack(std::span<const std::byte> bytes, int directive);
  void end_chunk();
  [[nodiscard]] std::string chunk_head(std::uint64_t length) const;
  void put_message_indices();
  void put_summary();
  [[nodiscard]] std::string statistics() const;

  std::FILE* file_ = nullptr;
  McapChunks chunks_ = McapChunks::kNone;
  std::unique_ptr<ZSTD_CCtx_s, Packer> packer_;
  std::string packed_;  // the room that the packer writes into
  bool in_chunk_ = false;
  ChunkPlace chunk_;                                      // in work
  std::uint32_t raw_checksum_ = 0, packed_checksum_ = 0;  // of it
  std::map<std::uint16_t, MessagePlaces> places_;         // in it
  std::vector<ChunkPlace> done_;
  std::vector<McapChannel> channels_;
  std::map<std::uint16_t, std::uint64_t> counts_;  // messages of each channel
  std::uint64_t position_ = 0;                     // in the file
  std::uint32_t checksum_ = 0;                     // of the file up to there, without the chunk in work
  int error_ = 0;
  bool finished_ = false;
};

struct McapMessage {
  std::uint16_t channel = 0;
  std::uint32_t sequence = 0;
  std::uint64_t time = 0;  // [ns]
  std::span<const std::byte> data;
};

struct McapFile {
  std::vector<McapChannel> channels;
  long messages = 0;
  bool whole = false;  // its end is there, and the checksums agree; otherwise its writer was stopped
};

// Calls `each` for every message of `bytes`, in order, with the channels so far. A file that ends in the middle of a
// record ends there, and a chunk that ends in its middle is unpacked as far as it goes; of that part no checksum is
// known. Throws InputError naming `name` for bytes that are no MCAP, a record whose content is shorter than it says, a
// channel that is not there, a checksum that disagrees, and a chunk that cannot be unpacked (zstd or none, at most 64
// MiB).
McapFile read_mcap(std::span<const std::byte> bytes, const std::string& name,
                   const std::function<void(const McapChannel&, const McapMessage&)>& each);

}  // namespace duet
