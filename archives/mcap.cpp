#include "duet/archives/mcap.h"

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>

#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

static_assert(std::endian::native == std::endian::little, "MCAP is little-endian, and so is this code");

constexpr std::string_view kMcapMagic("\x89MCAP0\r\n", 8);
constexpr std::size_t kRecordHead = 9;                     // kind, length
constexpr std::size_t kChunkHead = kRecordHead + 40;       // times, size, checksum, no packing, size
constexpr std::size_t kChunkBytes = std::size_t{4} << 20;  // of records, before they are packed
constexpr std::size_t kMostChunk = std::size_t{64} << 20;  // that is unpacked
constexpr int kZstdLevel = 9;
enum McapKind : std::uint8_t {
  kMcapHeader = 0x01,
  kMcapFooter = 0x02,
  kMcapSchema = 0x03,
  kMcapChannelRecord = 0x04,
  kMcapMessageRecord = 0x05,
  kMcapChunk = 0x06,
  kMcapDataEnd = 0x0F
};

std::string zstd_packed(std::string_view bytes) {
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size = ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), kZstdLevel);
  if (ZSTD_isError(size) != 0U) throw StorageError(fmt::format("zstd: {}", ZSTD_getErrorName(size)));
  packed.resize(size);
  return packed;
}

std::uint32_t more_checksum(std::uint32_t checksum, std::span<const std::byte> bytes) {
  if (bytes.empty()) return checksum;  // where there is no place at all, zlib begins anew
  return static_cast<std::uint32_t>(crc32_z(checksum, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

template <typename T>
std::string little(T value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

std::string sized(std::string_view text) { return little(static_cast<std::uint32_t>(text.size())) + std::string(text); }

std::span<const std::byte> bytes_of(std::string_view text) { return std::as_bytes(std::span(text)); }

// Reads fields of a record, and never past its end.
class McapFields {
 public:
  McapFields(std::span<const std::byte> bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  template <typename T>
  T number() {
    T value;
    std::memcpy(&value, take(sizeof(T)).data(), sizeof(T));
    return value;
  }
  std::string text() {
    const std::span<const std::byte> found = take(number<std::uint32_t>());
    return {reinterpret_cast<const char*>(found.data()), found.size()};
  }
  std::span<const std::byte> rest() { return take(bytes_.size()); }
  std::span<const std::byte> take(std::size_t size) {
    if (size > bytes_.size()) throw InputError(fmt::format("{}: expected a whole record, found a shorter one", name_));
    const std::span<const std::byte> taken = bytes_.first(size);
    bytes_ = bytes_.subspan(size);
    return taken;
  }

 private:
  std::span<const std::byte> bytes_;
  const std::string& name_;
};

McapChannel read_schema(McapFields fields) {
  McapChannel schema;
  schema.id = fields.number<std::uint16_t>();
  schema.schema_name = fields.text();
  schema.schema_encoding = fields.text();
  schema.schema = fields.text();
  return schema;
}

McapChannel read_channel(McapFields fields, const std::vector<McapChannel>& schemas, const std::string& name) {
  McapChannel channel;
  channel.id = fields.number<std::uint16_t>();
  const auto schema = fields.number<std::uint16_t>();
  channel.topic = fields.text();
  channel.message_encoding = fields.text();
  if (schema == 0) return channel;
  const auto found = std::ranges::find(schemas, schema, &McapChannel::id);
  if (found == schemas.end()) throw InputError(fmt::format("{}: expected schema {}, found none", name, schema));
  channel.schema_name = found->schema_name;
  channel.schema_encoding = found->schema_encoding;
  channel.schema = found->schema;
  return channel;
}

struct McapScan {
  std::span<const std::byte> bytes;
  const std::string& name;
  const std::function<void(const McapChannel&, const McapMessage&)>& each;
  McapFile file;
  std::vector<McapChannel> schemas;

  // Whole records, one after the other, up to a footer; `inside` a chunk there are no chunks.
  void records(std::span<const std::byte> all, std::size_t at, bool inside) {
    while (at + kRecordHead <= all.size()) {
      std::uint64_t length = 0;
      std::memcpy(&length, all.data() + at + 1, sizeof(length));
      if (length > all.size() - at - kRecordHead) return;
      const auto kind = static_cast<std::uint8_t>(all[at]);
      if (kind == kMcapFooter) return;
      const McapFields fields(all.subspan(at + kRecordHead, length), name);
      if (kind == kMcapChunk && !inside)
        chunk(fields);
      else
        read(kind, at, fields);
      at += kRecordHead + length;
    }
  }
  void chunk(McapFields fields) {
    (void)fields.number<std::uint64_t>();  // the first time
    (void)fields.number<std::uint64_t>();  // the last time
    const auto size = fields.number<std::uint64_t>();
    const auto checksum = fields.number<std::uint32_t>();
    const std::string packing = fields.text();
    const std::span<const std::byte> packed = fields.take(fields.number<std::uint64_t>());
    if (packing.empty()) {
      if (checksum != 0 && checksum != more_checksum(0, packed))
        throw InputError(fmt::format("{}: the checksum of a chunk does not agree", name));
      return records(packed, 0, true);
    }
    if (packing != "zstd" || size > kMostChunk)
      throw InputError(fmt::format("{}: expected chunks of at most {} bytes packed by zstd, found {} bytes by '{}'",
                                   name, kMostChunk, size, excerpt(packing)));
    std::vector<std::byte> unpacked(size);
    const std::size_t found = ZSTD_decompress(unpacked.data(), unpacked.size(), packed.data(), packed.size());
    if (ZSTD_isError(found) != 0U || found != size)
      throw InputError(fmt::format("{}: expected a chunk of {} bytes, found one that is not", name, size));
    if (checksum != 0 && checksum != more_checksum(0, unpacked))
      throw InputError(fmt::format("{}: the checksum of a chunk does not agree", name));
    records(unpacked, 0, true);
  }
  // The record at byte `at`; kinds that are not known are passed over.
  void read(std::uint8_t kind, std::size_t at, McapFields fields) {
    if (kind == kMcapSchema) schemas.push_back(read_schema(fields));
    if (kind == kMcapChannelRecord) file.channels.push_back(read_channel(fields, schemas, name));
    if (kind == kMcapMessageRecord) read_message(fields);
    if (kind != kMcapDataEnd) return;
    if (fields.number<std::uint32_t>() != more_checksum(0, bytes.first(at)))
      throw InputError(fmt::format("{}: the checksum of the data does not agree", name));
    file.whole = true;
  }
  void read_message(McapFields& fields) {
    McapMessage message;
    message.channel = fields.number<std::uint16_t>();
    message.sequence = fields.number<std::uint32_t>();
    message.time = fields.number<std::uint64_t>();
    (void)fields.number<std::uint64_t>();  // of publication, the same
    message.data = fields.rest();
    const auto channel = std::ranges::find(file.channels, message.channel, &McapChannel::id);
    if (channel == file.channels.end())
      throw InputError(fmt::format("{}: expected channel {}, found none", name, message.channel));
    ++file.messages;
    each(*channel, message);
  }
};

}  // namespace

McapWriter::McapWriter(const std::string& path, McapChunks chunks)
    : file_(std::fopen(path.c_str(), "wbx")), chunks_(chunks) {
  if (file_ == nullptr) throw StorageError(fmt::format("cannot make '{}': {}", path, std::strerror(errno)));
  put(bytes_of(kMcapMagic));
  put_record(kMcapHeader, sized("") + sized("duet"));
}

McapWriter::~McapWriter() {
  if (!finished_) (void)finish();
  std::fclose(file_);
}

void McapWriter::put(std::span<const std::byte> bytes) {
  checksum_ = more_checksum(checksum_, bytes);
  if (error_ == 0 && std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) error_ = errno;
}

void McapWriter::put_record(std::uint8_t kind, std::string_view content) {
  const std::string head = little(kind) + little(static_cast<std::uint64_t>(content.size()));
  put(bytes_of(head));
  put(bytes_of(content));
}

void McapWriter::gather(std::span<const std::byte> bytes) {
  if (chunks_ != McapChunks::kZstd) return put(bytes);
  chunk_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

void McapWriter::gather_record(std::uint8_t kind, std::string_view content) {
  const std::string head = little(kind) + little(static_cast<std::uint64_t>(content.size()));
  gather(bytes_of(head));
  gather(bytes_of(content));
}

void McapWriter::end_chunk() {
  if (chunk_.empty()) return;
  const std::string packed = zstd_packed(chunk_);
  put_record(kMcapChunk, little(chunk_begin_) + little(chunk_end_) + little(static_cast<std::uint64_t>(chunk_.size())) +
                             little(more_checksum(0, bytes_of(chunk_))) + sized("zstd") +
                             little(static_cast<std::uint64_t>(packed.size())) + packed);
  chunk_.clear();
  chunk_begin_ = chunk_end_ = 0;
}

void McapWriter::add(const McapChannel& channel) {
  const std::uint16_t schema = channel.schema_name.empty() ? std::uint16_t{0} : channel.id;
  if (schema != 0)
    gather_record(kMcapSchema,
                  little(schema) + sized(channel.schema_name) + sized(channel.schema_encoding) + sized(channel.schema));
  gather_record(kMcapChannelRecord, little(channel.id) + little(schema) + sized(channel.topic) +
                                        sized(channel.message_encoding) + sized(""));
}

// Writes the head of a chunk of one message, not packed. Allocates nothing: logs are written while a robot moves.
void McapWriter::put_chunk_head(std::uint64_t time, std::span<const std::byte> head, std::span<const std::byte> data) {
  const std::uint64_t size = head.size() + data.size(), length = kChunkHead - kRecordHead + size;
  const std::uint32_t checksum = more_checksum(more_checksum(0, head), data);
  std::array<std::byte, kChunkHead> chunk{};  // zeros at 37: the empty name of the packing
  chunk[0] = std::byte{kMcapChunk};
  std::memcpy(&chunk[1], &length, 8);
  std::memcpy(&chunk[9], &time, 8);
  std::memcpy(&chunk[17], &time, 8);
  std::memcpy(&chunk[25], &size, 8);
  std::memcpy(&chunk[33], &checksum, 4);
  std::memcpy(&chunk[41], &size, 8);
  put(chunk);
}

bool McapWriter::write(std::uint16_t channel, std::uint32_t sequence, std::uint64_t time,
                       std::span<const std::byte> data) {
  std::array<std::byte, kRecordHead + 22> head;
  const std::uint64_t length = 22 + data.size();
  head[0] = std::byte{kMcapMessageRecord};
  std::memcpy(&head[1], &length, 8);
  std::memcpy(&head[9], &channel, 2);
  std::memcpy(&head[11], &sequence, 4);
  std::memcpy(&head[15], &time, 8);
  std::memcpy(&head[23], &time, 8);
  if (chunks_ == McapChunks::kOneMessage) put_chunk_head(time, head, data);
  gather(head);
  gather(data);
  if (chunks_ != McapChunks::kZstd) return good();
  chunk_begin_ = chunk_end_ == 0 ? time : std::min(chunk_begin_, time);
  chunk_end_ = std::max(chunk_end_, time);
  if (chunk_.size() >= kChunkBytes) end_chunk();
  return good();
}

bool McapWriter::flush() {
  if (error_ == 0 && std::fflush(file_) != 0) error_ = errno;
  return good();
}

bool McapWriter::finish() {
  finished_ = true;
  end_chunk();
  put_record(kMcapDataEnd, little(checksum_));
  put_record(kMcapFooter, little(std::uint64_t{0}) + little(std::uint64_t{0}) + little(std::uint32_t{0}));
  put(bytes_of(kMcapMagic));
  return flush();
}

McapFile read_mcap(std::span<const std::byte> bytes, const std::string& name,
                   const std::function<void(const McapChannel&, const McapMessage&)>& each) {
  if (bytes.size() < kMcapMagic.size() || std::memcmp(bytes.data(), kMcapMagic.data(), kMcapMagic.size()) != 0)
    throw InputError(fmt::format("{}: expected an MCAP file, found another", name));
  McapScan scan{bytes, name, each, {}, {}};
  scan.records(bytes, kMcapMagic.size(), false);
  return scan.file;
}

}  // namespace duet
