// MCAP files, the container of robot logs that Foxglove's tools read: append-only, so that a file whose writer was
// killed can be read up to the last whole record; of logs that is a message, with a checksum of its own, of compressed
// files a chunk of some megabytes. Source: the MCAP specification, version 0.
#pragma once

#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

struct McapChannel {
  std::uint16_t id = 0;
  std::string topic;             // "guard/tick"
  std::string message_encoding;  // "cdr", "json", ...
  // None where the name is empty.
  std::string schema_name, schema_encoding, schema;
};

// None; each message as a chunk of its own, not packed, whose checksum holds where the file is cut; some megabytes by
// zstd.
enum class McapChunks { kNone, kOneMessage, kZstd };

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
  bool flush();  // of chunks the whole ones
  // The end of the data with its checksum; nothing may follow. False as above.
  bool finish();
  [[nodiscard]] bool good() const { return error_ == 0; }
  [[nodiscard]] int error() const { return error_; }  // of errno, the first; 0: none

 private:
  void put(std::span<const std::byte> bytes);
  void put_record(std::uint8_t kind, std::string_view content);
  // Adds to the chunk, where there are chunks.
  void gather(std::span<const std::byte> bytes);
  void gather_record(std::uint8_t kind, std::string_view content);
  void end_chunk();
  void put_chunk_head(std::uint64_t time, std::span<const std::byte> head, std::span<const std::byte> data);

  std::FILE* file_ = nullptr;
  McapChunks chunks_ = McapChunks::kNone;
  std::string chunk_;                              // records that are not in the file yet
  std::uint64_t chunk_begin_ = 0, chunk_end_ = 0;  // times of its messages [ns]; 0, 0: it has none
  std::uint32_t checksum_ = 0;
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
  bool whole = false;  // its end is there, and the checksum agrees; otherwise its writer was stopped
};

// Calls `each` for every message of `bytes`, in order, with the channels so far. A file that ends in the middle of a
// record ends there. Throws InputError naming `name` for bytes that are no MCAP, a record whose content is shorter than
// it says, a channel that is not there, a checksum that disagrees, and a chunk that cannot be unpacked (zstd or none,
// at most 64 MiB).
McapFile read_mcap(std::span<const std::byte> bytes, const std::string& name,
                   const std::function<void(const McapChannel&, const McapMessage&)>& each);

}  // namespace duet
