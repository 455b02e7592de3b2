#include "duet/archives/mcap.h"

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <memory>

#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

static_assert(std::endian::native == std::endian::little, "MCAP is little-endian, and so is this code");

constexpr std::string_view kMcapMagic("\x89MCAP0\r\n", 8);
constexpr std::size_t kRecordHead = 9;                     // kind, length
constexpr std::size_t kDataEndBytes = kRecordHead + 4;     // with its checksum
constexpr std::size_t kFooterBytes = kRecordHead + 20;     // where summary and offsets begin, checksum
constexpr std::size_t kChunkBytes = std::size_t{4} << 20;  // of records, before they are packed: 1.5 s of a log
constexpr std::size_t kMostChunk = std::size_t{64} << 20;  // that is unpacked
// The length of a chunk in work: more than any has, so that readers find a file that ends in its middle.
constexpr std::uint64_t kUnknownLength = kMostChunk;
constexpr int kFastLevel = 3, kSmallLevel = 9;  // of zstd
enum McapKind : std::uint8_t {
  kMcapHeader = 0x01,
  kMcapFooter = 0x02,
  kMcapSchema = 0x03,
  kMcapChannelRecord = 0x04,
  kMcapMessageRecord = 0x05,
  kMcapChunk = 0x06,
  kMcapMessageIndex = 0x07,
  kMcapChunkIndex = 0x08,
  kMcapStatistics = 0x0B,
  kMcapSummaryOffset = 0x0E,
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

// A list with its length in bytes: pairs of numbers.
template <typename Pairs>
std::string listed(const Pairs& pairs) {
  std::string bytes;
  for (const auto& [first, second] : pairs) bytes += little(first) + little(second);
  return sized(bytes);
}

std::string schema_content(const McapChannel& channel) {
  return little(channel.id) + sized(channel.schema_name) + sized(channel.schema_encoding) + sized(channel.schema);
}

std::string channel_content(const McapChannel& channel) {
  const std::uint16_t schema = channel.schema_name.empty() ? std::uint16_t{0} : channel.id;
  return little(channel.id) + little(schema) + sized(channel.topic) + sized(channel.message_encoding) + sized("");
}

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

  // Whole records, one after the other, up to the end of the data; `inside` a chunk there are no chunks.
  void records(std::span<const std::byte> all, std::size_t at, bool inside) {
    while (at + kRecordHead <= all.size()) {
      std::uint64_t length = 0;
      std::memcpy(&length, all.data() + at + 1, sizeof(length));
      const auto kind = static_cast<std::uint8_t>(all[at]);
      const bool chunks = kind == kMcapChunk && !inside;
      if (length > all.size() - at - kRecordHead) return chunks ? cut_chunk(all.subspan(at + kRecordHead)) : void();
      if (kind == kMcapFooter) return;
      const McapFields fields(all.subspan(at + kRecordHead, length), name);
      if (kind == kMcapDataEnd && !inside) return data_end(at, fields);
      if (chunks)
        chunk(fields);
      else
        read(kind, fields);
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
  // A chunk whose end is not there: its writer was stopped, or the file was cut. Sizes and checksum say nothing yet.
  void cut_chunk(std::span<const std::byte> rest) {
    constexpr std::size_t kBefore = 28, kAfter = 8;  // times, size, checksum; the packed size
    if (rest.size() < kBefore + sizeof(std::uint32_t)) return;
    std::uint32_t length = 0;
    std::memcpy(&length, rest.data() + kBefore, sizeof(length));
    const std::size_t head = kBefore + sizeof(length) + length + kAfter;
    if (rest.size() <= head) return;
    const std::string packing = McapFields(rest.subspan(kBefore), name).text();
    if (packing.empty()) return records(rest.subspan(head), 0, true);
    if (packing == "zstd") records(unpacked_start(rest.subspan(head)), 0, true);
  }
  // The beginning of a packed chunk, unpacked.
  [[nodiscard]] std::vector<std::byte> unpacked_start(std::span<const std::byte> packed) const {
    constexpr std::size_t kStep = std::size_t{1} << 18;
    const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> stream(ZSTD_createDCtx(), &ZSTD_freeDCtx);
    std::vector<std::byte> unpacked;
    ZSTD_inBuffer in{packed.data(), packed.size(), 0};
    for (bool more = true; more;) {
      const std::size_t before = unpacked.size();
      if (before > kMostChunk)
        throw InputError(fmt::format("{}: expected chunks of at most {} bytes, found a larger one", name, kMostChunk));
      unpacked.resize(before + kStep);
      ZSTD_outBuffer out{unpacked.data() + before, kStep, 0};
      const std::size_t left = ZSTD_decompressStream(stream.get(), &out, &in);
      if (ZSTD_isError(left) != 0U)
        throw InputError(fmt::format("{}: the last chunk, which has no end, cannot be unpacked", name));
      unpacked.resize(before + out.pos);
      more = left != 0 && (out.pos == kStep || in.pos < in.size);
    }
    return unpacked;
  }
  // The end of the data at byte `at`. Behind it stands the index with a checksum of its own, or only a footer.
  void data_end(std::size_t at, McapFields fields) {
    if (fields.number<std::uint32_t>() != more_checksum(0, bytes.first(at)))
      throw InputError(fmt::format("{}: the checksum of the data does not agree", name));
    const std::span<const std::byte> rest = bytes.subspan(at + kDataEndBytes);
    if (rest.size() < kFooterBytes + kMcapMagic.size()) return;
    const std::size_t footer = rest.size() - kFooterBytes - kMcapMagic.size();
    const bool ends = std::memcmp(rest.data() + footer + kFooterBytes, kMcapMagic.data(), kMcapMagic.size()) == 0;
    if (!ends || static_cast<std::uint8_t>(rest[footer]) != kMcapFooter) return;
    std::uint32_t checksum = 0;
    std::memcpy(&checksum, rest.data() + footer + kFooterBytes - sizeof(checksum), sizeof(checksum));
    if (checksum != 0 && checksum != more_checksum(0, rest.first(footer + kFooterBytes - sizeof(checksum))))
      throw InputError(fmt::format("{}: the checksum of the index does not agree", name));
    file.whole = true;
  }
  // Kinds that are not known are passed over.
  void read(std::uint8_t kind, McapFields fields) {
    if (kind == kMcapSchema) schemas.push_back(read_schema(fields));
    if (kind == kMcapChannelRecord) file.channels.push_back(read_channel(fields, schemas, name));
    if (kind == kMcapMessageRecord) read_message(fields);
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

void McapWriter::Packer::operator()(ZSTD_CCtx_s* stream) const { ZSTD_freeCCtx(stream); }

McapWriter::McapWriter(const std::string& path, McapChunks chunks)
    : file_(std::fopen(path.c_str(), "wbx")), chunks_(chunks) {
  if (file_ == nullptr) throw StorageError(fmt::format("cannot make '{}': {}", path, std::strerror(errno)));
  if (chunks_ != McapChunks::kNone) {
    packer_.reset(ZSTD_createCCtx());
    ZSTD_CCtx_setParameter(packer_.get(), ZSTD_c_compressionLevel,
                           chunks_ == McapChunks::kFast ? kFastLevel : kSmallLevel);
    packed_.resize(ZSTD_CStreamOutSize());
  }
  put(bytes_of(kMcapMagic));
  put_record(kMcapHeader, sized("") + sized("duet"));
}

McapWriter::~McapWriter() {
  if (!finished_) (void)finish();
  std::fclose(file_);
}

void McapWriter::put(std::span<const std::byte> bytes) {
  (in_chunk_ ? packed_checksum_ : checksum_) = more_checksum(in_chunk_ ? packed_checksum_ : checksum_, bytes);
  position_ += bytes.size();
  if (error_ == 0 && std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) error_ = errno;
}

void McapWriter::put_record(std::uint8_t kind, std::string_view content) {
  const std::string head = little(kind) + little(static_cast<std::uint64_t>(content.size()));
  put(bytes_of(head));
  put(bytes_of(content));
}

void McapWriter::gather(std::span<const std::byte> bytes) {
  if (chunks_ == McapChunks::kNone) return put(bytes);
  if (!in_chunk_) begin_chunk();
  raw_checksum_ = more_checksum(raw_checksum_, bytes);
  chunk_.raw += bytes.size();
  pack(bytes, ZSTD_e_continue);
}

void McapWriter::gather_record(std::uint8_t kind, std::string_view content) {
  const std::string head = little(kind) + little(static_cast<std::uint64_t>(content.size()));
  gather(bytes_of(head));
  gather(bytes_of(content));
}

// The head of the chunk in work, of a record of this length.
std::string McapWriter::chunk_head(std::uint64_t length) const {
  return little(std::uint8_t{kMcapChunk}) + little(length) + little(chunk_.first_time) + little(chunk_.last_time) +
         little(chunk_.raw) + little(raw_checksum_) + sized("zstd") + little(chunk_.packed);
}

// Its head is written again when it ends: sizes and checksum are not known before.
void McapWriter::begin_chunk() {
  chunk_ = {};
  chunk_.at = position_;
  raw_checksum_ = packed_checksum_ = 0;
  places_.clear();
  in_chunk_ = true;
  const std::string head = chunk_head(kUnknownLength);
  put(bytes_of(head));
  packed_checksum_ = 0;  // of what follows the head
}

void McapWriter::pack(std::span<const std::byte> bytes, int directive) {
  ZSTD_inBuffer in{bytes.data(), bytes.size(), 0};
  for (bool more = true; more;) {
    ZSTD_outBuffer out{packed_.data(), packed_.size(), 0};
    const auto how = static_cast<ZSTD_EndDirective>(directive);
    const std::size_t left = ZSTD_compressStream2(packer_.get(), &out, &in, how);
    if (ZSTD_isError(left) != 0U) {
      if (error_ == 0) error_ = ENOMEM;  // the only reason that it has
      return;
    }
    put(bytes_of(std::string_view(packed_.data(), out.pos)));
    chunk_.packed += out.pos;
    more = how == ZSTD_e_continue ? in.pos < in.size : left != 0;
  }
}

void McapWriter::end_chunk() {
  if (!in_chunk_) return;
  pack({}, ZSTD_e_end);
  in_chunk_ = false;
  chunk_.length = position_ - chunk_.at;
  const std::string head = chunk_head(chunk_.length - kRecordHead);
  checksum_ = static_cast<std::uint32_t>(
      crc32_combine(more_checksum(checksum_, bytes_of(head)), packed_checksum_, static_cast<z_off_t>(chunk_.packed)));
  if (error_ == 0 &&
      (std::fseek(file_, static_cast<long>(chunk_.at), SEEK_SET) != 0 ||
       std::fwrite(head.data(), 1, head.size(), file_) != head.size() || std::fseek(file_, 0, SEEK_END) != 0))
    error_ = errno;
  put_message_indices();
  done_.push_back(chunk_);
}

void McapWriter::put_message_indices() {
  const std::uint64_t begin = position_;
  for (auto& [channel, places] : places_) {
    std::ranges::stable_sort(places, {}, &std::pair<std::uint64_t, std::uint64_t>::first);
    chunk_.indices[channel] = position_;
    put_record(kMcapMessageIndex, little(channel) + listed(places));
  }
  chunk_.index_length = position_ - begin;
}

void McapWriter::add(const McapChannel& channel) {
  if (!channel.schema_name.empty()) gather_record(kMcapSchema, schema_content(channel));
  gather_record(kMcapChannelRecord, channel_content(channel));
  channels_.push_back(channel);
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
  const std::uint64_t place = in_chunk_ ? chunk_.raw : 0;
  gather(head);
  gather(data);
  if (chunks_ == McapChunks::kNone) return good();
  chunk_.first_time = places_.empty() ? time : std::min(chunk_.first_time, time);
  chunk_.last_time = std::max(chunk_.last_time, time);
  places_[channel].emplace_back(time, place);
  ++counts_[channel];
  if (chunk_.raw >= kChunkBytes) end_chunk();
  return good();
}

bool McapWriter::flush() {
  if (in_chunk_) pack({}, ZSTD_e_flush);
  if (error_ == 0 && std::fflush(file_) != 0) error_ = errno;
  return good();
}

std::string McapWriter::statistics() const {
  std::uint64_t messages = 0, first = 0, last = 0;
  for (const auto& [channel, count] : counts_) messages += count;
  bool any = false;
  for (const ChunkPlace& chunk : done_) {
    if (chunk.indices.empty()) continue;
    first = any ? std::min(first, chunk.first_time) : chunk.first_time;
    last = std::max(last, chunk.last_time);
    any = true;
  }
  const auto schemas = std::ranges::count_if(channels_, [](const McapChannel& c) { return !c.schema_name.empty(); });
  return little(messages) + little(static_cast<std::uint16_t>(schemas)) +
         little(static_cast<std::uint32_t>(channels_.size())) +
         little(std::uint64_t{0}) +  // no attachment, no metadata
         little(static_cast<std::uint32_t>(done_.size())) + little(first) + little(last) + listed(counts_);
}

// Schemas, channels, statistics and the places of the chunks, each kind a group with its place, then the footer.
void McapWriter::put_summary() {
  checksum_ = 0;  // of the summary, with the footer up to there
  const std::uint64_t begin = position_;
  std::string offsets;
  const auto group = [&](McapKind kind, const std::vector<std::string>& contents) {
    const std::uint64_t at = position_;
    for (const std::string& content : contents) put_record(kind, content);
    if (position_ > at)
      offsets += little(std::uint8_t{kMcapSummaryOffset}) + little(std::uint64_t{17}) + little(std::uint8_t{kind}) +
                 little(at) + little(position_ - at);
  };
  std::vector<std::string> schemas, channels, chunks;
  for (const McapChannel& channel : channels_) {
    if (!channel.schema_name.empty()) schemas.push_back(schema_content(channel));
    channels.push_back(channel_content(channel));
  }
  for (const ChunkPlace& chunk : done_)
    chunks.push_back(little(chunk.first_time) + little(chunk.last_time) + little(chunk.at) + little(chunk.length) +
                     listed(chunk.indices) + little(chunk.index_length) + sized("zstd") + little(chunk.packed) +
                     little(chunk.raw));
  group(kMcapSchema, schemas);
  group(kMcapChannelRecord, channels);
  group(kMcapStatistics, {statistics()});
  group(kMcapChunkIndex, chunks);
  const std::uint64_t offsets_at = position_;
  put(bytes_of(offsets));
  const std::string footer =
      little(std::uint8_t{kMcapFooter}) + little(std::uint64_t{20}) + little(begin) + little(offsets_at);
  put(bytes_of(footer));
  const std::string checksum = little(checksum_);
  put(bytes_of(checksum));
}

bool McapWriter::finish() {
  finished_ = true;
  end_chunk();
  put_record(kMcapDataEnd, little(checksum_));
  if (done_.empty())
    put_record(kMcapFooter, little(std::uint64_t{0}) + little(std::uint64_t{0}) + little(std::uint32_t{0}));
  else
    put_summary();
  put(bytes_of(kMcapMagic));
  if (error_ == 0 && std::fflush(file_) != 0) error_ = errno;
  return good();
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
