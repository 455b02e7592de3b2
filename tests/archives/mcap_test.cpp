#include "duet/archives/mcap.h"

#include <gmock/gmock.h>
#include <zstd.h>

#include <cstring>
#include <map>
#include <vector>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::ElementsAre;

std::span<const std::byte> bytes_of(const std::string& text) { return std::as_bytes(std::span(text)); }

TEST(Mcap, WhatIsWrittenIsRead) {
  const test::ScratchFolder folder;
  {
    McapWriter writer(folder / "a.mcap");
    writer.add({1, "first", "json", "", "", ""});
    writer.add({2, "second", "cdr", "Type", "omgidl", "struct Type {};"});
    EXPECT_TRUE(writer.write(2, 7, 1234567890123, bytes_of("abc")));
    EXPECT_TRUE(writer.write(1, 8, 5, bytes_of("")));
  }
  std::vector<std::string> found;
  const std::string bytes = read_file(folder / "a.mcap");
  const McapFile file = read_mcap(bytes_of(bytes), "a.mcap", [&](const McapChannel& c, const McapMessage& m) {
    found.push_back(c.topic + c.schema_name + std::to_string(m.sequence) + "@" + std::to_string(m.time) + ":" +
                    std::string(reinterpret_cast<const char*>(m.data.data()), m.data.size()));
  });
  EXPECT_THAT(found, ElementsAre("secondType7@1234567890123:abc", "first8@5:"));
  EXPECT_TRUE(file.whole);
  EXPECT_EQ(file.messages, 2);
}

std::vector<std::string> messages_of(const std::string& bytes) {
  std::vector<std::string> found;
  read_mcap(bytes_of(bytes), "a.mcap", [&](const McapChannel& c, const McapMessage& m) {
    found.push_back(c.topic + std::to_string(m.sequence) + std::to_string(m.data.size()));
  });
  return found;
}

std::string chunked_file(const std::string& path) {
  const std::string long_text(3'000'000, 'x');
  {
    McapWriter writer(path, McapChunks::kSmall);
    writer.add({1, "first", "json", "Type", "jsonschema", "{}"});
    writer.write(1, 1, 10, bytes_of(long_text));
    writer.write(1, 2, 20, bytes_of(long_text));  // a chunk is full
    writer.add({2, "second", "json", "", "", ""});
    writer.write(2, 3, 30, bytes_of("abc"));
  }
  return read_file(path);
}

TEST(Mcap, ChunksAreSmallAndHoldTheSame) {
  const test::ScratchFolder folder;
  const std::string bytes = chunked_file(folder / "a.mcap");
  EXPECT_LT(bytes.size(), 10'000U);
  EXPECT_THAT(messages_of(bytes), ElementsAre("first13000000", "first23000000", "second33"));
  const std::size_t second = bytes.find("zstd", bytes.find("zstd") + 1);
  ASSERT_NE(second, std::string::npos);
  EXPECT_THAT(messages_of(bytes.substr(0, second)), ElementsAre("first13000000", "first23000000"));
}

TEST(Mcap, AChunkThatCannotBeUnpackedIsNamed) {
  const test::ScratchFolder folder;
  const std::string bytes = chunked_file(folder / "a.mcap");
  const auto refusal = [](const std::string& file) {
    return test::thrown_message<InputError>([&] { static_cast<void>(messages_of(file)); });
  };
  const std::size_t name = bytes.find("zstd");
  std::string other = bytes;
  other.replace(name, 4, "lzma");
  EXPECT_SENTENCE(refusal(other));
  std::string huge = bytes;
  huge.replace(name - 16, 8, std::string(8, '\x7f'));  // what it says to unpack to
  EXPECT_SENTENCE(refusal(huge));
  std::string broken = bytes;
  broken.replace(name + 12, 4, "junk");  // of the packed bytes
  EXPECT_SENTENCE(refusal(broken));
  std::string sum = bytes;
  sum[name - 8] = static_cast<char>(sum[name - 8] + 1);
  EXPECT_SENTENCE(refusal(sum));
}

// The bytes that the format's specification prescribes, for its smallest file: magic, header, end of data, footer,
// magic.
TEST(Mcap, TheSmallestFileHasTheBytesOfTheSpecification) {
  const test::ScratchFolder folder;
  { McapWriter writer(folder / "a.mcap"); }
  const std::string bytes = read_file(folder / "a.mcap");
  const std::string magic("\x89MCAP0\r\n", 8);
  ASSERT_EQ(bytes.size(), 8u + (9 + 4 + 8) + (9 + 4) + (9 + 20) + 8);
  EXPECT_EQ(bytes.substr(0, 8), magic);
  EXPECT_EQ(bytes.substr(bytes.size() - 8), magic);
  EXPECT_EQ(bytes.substr(8, 13), std::string("\x01\x0c\0\0\0\0\0\0\0\0\0\0\0", 13));
  EXPECT_EQ(bytes.substr(29, 9), std::string("\x0f\x04\0\0\0\0\0\0\0", 9));
  EXPECT_EQ(bytes.substr(42, 9), std::string("\x02\x14\0\0\0\0\0\0\0", 9));
}

TEST(Mcap, AFileIsNotMadeTwice) {
  const test::ScratchFolder folder;
  { McapWriter writer(folder / "a.mcap"); }
  EXPECT_SENTENCE(test::thrown_message<StorageError>([&] { McapWriter writer(folder / "a.mcap"); }));
}

std::string small_file(const test::ScratchFolder& folder) {
  {
    McapWriter writer(folder / "small.mcap");
    writer.add({1, "first", "json", "", "", ""});
    for (int k = 0; k < 5; ++k) writer.write(1, k, k, bytes_of("abcdef"));
  }
  return read_file(folder / "small.mcap");
}

TEST(Mcap, AFileOfAKilledWriterIsReadToItsLastRecord) {
  const test::ScratchFolder folder;
  const std::string bytes = small_file(folder);
  long before = 0;
  for (std::size_t length = 8; length < bytes.size(); ++length) {
    const McapFile file =
        read_mcap(bytes_of(bytes).first(length), "cut", [](const McapChannel&, const McapMessage&) {});
    EXPECT_GE(file.messages, before) << length;
    before = file.messages;
  }
  EXPECT_EQ(before, 5);
}

TEST(Mcap, RefusesWhatIsDamaged) {
  const test::ScratchFolder folder;
  const std::string good = small_file(folder);
  const auto refusal = [](const std::string& bytes) {
    return test::thrown_message<InputError>(
        [&] { read_mcap(bytes_of(bytes), "x.mcap", [](const McapChannel&, const McapMessage&) {}); });
  };
  EXPECT_SENTENCE(refusal("not an mcap file at all"));
  std::string bad = good;
  bad[good.find("abcdef")] ^= 1;
  EXPECT_SENTENCE(refusal(bad));
  bad = good;
  bad[good.find("abcdef") - 22] = 9;
  EXPECT_SENTENCE(refusal(bad));
}

// Three chunks of messages that cannot be packed well, on two channels.
std::vector<std::string> noise() {
  std::vector<std::string> messages;
  std::uint32_t x = 1;
  for (int k = 0; k < 100; ++k) {
    std::string& message = messages.emplace_back(100'000, ' ');
    for (char& c : message) {
      x = x * 1664525U + 1013904223U;
      c = static_cast<char>(x >> 26);
    }
  }
  return messages;
}

void write_noise(McapWriter& writer) {
  writer.add({1, "first", "json", "Type", "jsonschema", "{}"});
  writer.add({2, "second", "json", "", "", ""});
  std::uint32_t k = 0;
  for (const std::string& message : noise()) {
    writer.write(k % 3 == 0 ? 2 : 1, k, 1000 + 10 * k, bytes_of(message));
    ++k;
  }
}

// A writer that is killed leaves what it flushed, in a chunk without an end; so does a file that is cut anywhere.
TEST(Mcap, AChunkInWorkIsReadAsFarAsItWasFlushed) {
  const test::ScratchFolder folder;
  McapWriter writer(folder / "a.mcap", McapChunks::kFast);
  write_noise(writer);
  ASSERT_TRUE(writer.flush());
  const std::string bytes = read_file(folder / "a.mcap");
  long read = 0;
  const std::vector<std::string> written = noise();
  const auto each = [&](const McapChannel&, const McapMessage& message) {
    const std::string& expected = written[message.sequence];
    ASSERT_EQ(message.data.size(), expected.size());
    EXPECT_EQ(std::memcmp(message.data.data(), expected.data(), expected.size()), 0);
    ++read;
  };
  EXPECT_FALSE(read_mcap(bytes_of(bytes), "a.mcap", each).whole);
  EXPECT_EQ(read, 100);
}

TEST(Mcap, APackedFileThatIsCutAnywhereIsReadAsFarAsItGoes) {
  const test::ScratchFolder folder;
  {
    McapWriter writer(folder / "a.mcap", McapChunks::kFast);
    write_noise(writer);
  }
  const std::string bytes = read_file(folder / "a.mcap");
  long before = 0, grew = 0;
  for (std::size_t length = 8; length < bytes.size(); length += 99'991) {
    const McapFile file =
        read_mcap(bytes_of(bytes).first(length), "cut", [](const McapChannel&, const McapMessage&) {});
    EXPECT_GE(file.messages, before) << length;
    EXPECT_FALSE(file.whole) << length;
    grew += file.messages > before ? 1 : 0;
    before = file.messages;
  }
  EXPECT_GT(grew, 50);  // also inside of chunks
  const McapFile file =
      read_mcap(bytes_of(bytes).first(bytes.size() - 1), "cut", [](const McapChannel&, const McapMessage&) {});
  EXPECT_EQ(file.messages, 100);
  EXPECT_FALSE(file.whole);  // the index has no end
}

// Reads numbers of the specification's records one after the other.
struct Numbers {
  std::span<const std::byte> rest;
  template <typename T>
  T next() {
    T value{};
    std::memcpy(&value, rest.data(), sizeof(T));
    rest = rest.subspan(sizeof(T));
    return value;
  }
};

// As viewers seek: footer, places of the chunks, places of messages in a chunk, the message there.
TEST(Mcap, TheIndexLeadsToEveryMessage) {
  const test::ScratchFolder folder;
  {
    McapWriter writer(folder / "a.mcap", McapChunks::kFast);
    write_noise(writer);
  }
  const std::string bytes = read_file(folder / "a.mcap");
  const std::span<const std::byte> all = bytes_of(bytes);
  Numbers footer{all.subspan(all.size() - 8 - 20)};
  auto at = footer.next<std::uint64_t>();
  std::map<int, int> kinds;
  std::vector<std::string> found(100);
  for (int kind = 0; kind != 0x02;) {
    Numbers record{all.subspan(at)};
    kind = record.next<std::uint8_t>();
    const auto length = record.next<std::uint64_t>();
    at += 9 + length;
    ++kinds[kind];
    if (kind != 0x08) continue;
    const auto first = record.next<std::uint64_t>(), last = record.next<std::uint64_t>();
    Numbers chunk{all.subspan(record.next<std::uint64_t>())};
    (void)record.next<std::uint64_t>();  // the chunk's length
    chunk.rest = chunk.rest.subspan(9 + 16);
    std::vector<std::byte> unpacked(chunk.next<std::uint64_t>());
    chunk.rest = chunk.rest.subspan(4 + 4 + 4);  // checksum, "zstd"
    const auto packed = chunk.next<std::uint64_t>();
    ASSERT_EQ(ZSTD_decompress(unpacked.data(), unpacked.size(), chunk.rest.data(), packed), unpacked.size());
    for (auto channels = record.next<std::uint32_t>() / 10; channels > 0; --channels) {
      const auto channel = record.next<std::uint16_t>();
      Numbers index{all.subspan(record.next<std::uint64_t>())};
      ASSERT_EQ(index.next<std::uint8_t>(), 0x07);
      (void)index.next<std::uint64_t>();
      ASSERT_EQ(index.next<std::uint16_t>(), channel);
      for (auto messages = index.next<std::uint32_t>() / 16; messages > 0; --messages) {
        const auto time = index.next<std::uint64_t>();
        EXPECT_TRUE(first <= time && time <= last);
        Numbers message{std::span<const std::byte>(unpacked).subspan(index.next<std::uint64_t>())};
        ASSERT_EQ(message.next<std::uint8_t>(), 0x05);
        const auto size = message.next<std::uint64_t>() - 22;
        EXPECT_EQ(message.next<std::uint16_t>(), channel);
        const auto sequence = message.next<std::uint32_t>();
        EXPECT_EQ(message.next<std::uint64_t>(), time);
        message.rest = message.rest.subspan(8);
        found.at(sequence) = {reinterpret_cast<const char*>(message.rest.data()), size};
      }
    }
  }
  EXPECT_EQ(found, noise());
  EXPECT_EQ(kinds, (std::map<int, int>{{0x02, 1}, {0x03, 1}, {0x04, 2}, {0x08, 3}, {0x0B, 1}, {0x0E, 4}}));
}

TEST(Mcap, AnIndexThatIsDamagedIsNamed) {
  const test::ScratchFolder folder;
  std::string bytes = chunked_file(folder / "a.mcap");
  bytes[bytes.size() - 60] = static_cast<char>(bytes[bytes.size() - 60] ^ 1);
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { static_cast<void>(messages_of(bytes)); }));
}

TEST(Mcap, AChunkWithoutAnEndThatCannotBeUnpackedIsNamed) {
  const test::ScratchFolder folder;
  std::string bytes = chunked_file(folder / "a.mcap");
  const std::size_t name = bytes.find("zstd");
  bytes.replace(name + 12, 4, "junk");
  bytes.resize(name + 20);
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { static_cast<void>(messages_of(bytes)); }));
}

}  // namespace
}  // namespace duet
