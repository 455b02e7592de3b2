#include "duet/hardware/mcap.h"

#include <fmt/format.h>
#include <zlib.h>

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
constexpr std::size_t kRecordHead = 9;  // kind, length
enum McapKind : std::uint8_t {
  kMcapHeader = 0x01,
  kMcapFooter = 0x02,
  kMcapSchema = 0x03,
  kMcapChannelRecord = 0x04,
  kMcapMessageRecord = 0x05,
  kMcapDataEnd = 0x0F
};

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

 private:
  std::span<const std::byte> take(std::size_t size) {
    if (size > bytes_.size()) throw InputError(fmt::format("{}: expected a whole record, found a shorter one", name_));
    const std::span<const std::byte> taken = bytes_.first(size);
    bytes_ = bytes_.subspan(size);
    return taken;
  }

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

McapWriter::McapWriter(const std::string& path) : file_(std::fopen(path.c_str(), "wbx")) {
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
  good_ = good_ && std::fwrite(bytes.data(), 1, bytes.size(), file_) == bytes.size();
}

void McapWriter::put_record(std::uint8_t kind, std::string_view content) {
  const std::string head = little(kind) + little(static_cast<std::uint64_t>(content.size()));
  put(bytes_of(head));
  put(bytes_of(content));
}

void McapWriter::add(const McapChannel& channel) {
  const std::uint16_t schema = channel.schema_name.empty() ? std::uint16_t{0} : channel.id;
  if (schema != 0)
    put_record(kMcapSchema,
               little(schema) + sized(channel.schema_name) + sized(channel.schema_encoding) + sized(channel.schema));
  put_record(kMcapChannelRecord,
             little(channel.id) + little(schema) + sized(channel.topic) + sized(channel.message_encoding) + sized(""));
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
  put(head);
  put(data);
  return good_;
}

bool McapWriter::flush() {
  good_ = good_ && std::fflush(file_) == 0;
  return good_;
}

bool McapWriter::finish() {
  finished_ = true;
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
  for (std::size_t at = kMcapMagic.size(); at + kRecordHead <= bytes.size();) {
    std::uint64_t length = 0;
    std::memcpy(&length, bytes.data() + at + 1, sizeof(length));
    if (length > bytes.size() - at - kRecordHead) break;
    const auto kind = static_cast<std::uint8_t>(bytes[at]);
    if (kind == kMcapFooter) break;
    scan.read(kind, at, McapFields(bytes.subspan(at + kRecordHead, length), name));
    at += kRecordHead + length;
  }
  return scan.file;
}

}  // namespace duet
