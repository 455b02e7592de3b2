// A file that is no archive of plain arrays is refused with InputError: never a crash, never a guess.
#include <algorithm>
#include <cstring>

#include "duet/archives/npy/npy.h"
#include "duet/archives/npy/npz.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

std::string npy_with(const std::string& dictionary, const std::string& data) {
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(dictionary.size() & 0xff);
  bytes += static_cast<char>(dictionary.size() >> 8);
  return bytes + dictionary + data;
}

std::string npy_of(const std::string& type, const std::string& shape, const std::string& data, bool fortran = false) {
  return npy_with(
      "{'descr': '" + type + "', 'fortran_order': " + (fortran ? "True" : "False") + ", 'shape': " + shape + ", }\n",
      data);
}

NpyArray parsed(const std::string& type, const std::string& shape, const std::string& data, bool fortran = false) {
  return parse_npy(npy_of(type, shape, data, fortran));
}

std::string refusal(const std::string& npy) {
  return thrown_message<InputError>([&] { parse_npy(npy); });
}

template <typename T>
std::string raw(std::initializer_list<T> values, bool swapped = false) {
  std::string bytes;
  for (const T value : values) {
    char data[sizeof(T)];
    std::memcpy(data, &value, sizeof(T));
    if (swapped) std::reverse(data, data + sizeof(T));
    bytes.append(data, sizeof(T));
  }
  return bytes;
}

using Doubles = std::vector<double>;
using Integers = std::vector<std::int64_t>;
using Strings = std::vector<std::string>;

template <typename T>
void expect_integers(const std::string& type) {
  const T low = std::numeric_limits<T>::min(), high = std::numeric_limits<T>::max() / 2;
  const Integers expected = {static_cast<std::int64_t>(low), static_cast<std::int64_t>(high), 1};
  EXPECT_EQ(std::get<Integers>(parsed("<" + type, "(3,)", raw<T>({low, high, 1})).values), expected) << type;
  EXPECT_EQ(std::get<Integers>(parsed(">" + type, "(3,)", raw<T>({low, high, 1}, true)).values), expected) << type;
}

TEST(Npy, ReadsEveryPlainTypeInBothByteOrders) {
  expect_integers<std::int8_t>("i1");
  expect_integers<std::int16_t>("i2");
  expect_integers<std::int32_t>("i4");
  expect_integers<std::int64_t>("i8");
  expect_integers<std::uint8_t>("u1");
  expect_integers<std::uint16_t>("u2");
  expect_integers<std::uint32_t>("u4");
  expect_integers<std::uint64_t>("u8");
  EXPECT_EQ(std::get<Integers>(parsed("|b1", "(2,)", raw<bool>({true, false})).values), (Integers{1, 0}));
  for (const bool swapped : {false, true}) {
    const std::string order = swapped ? ">" : "<";
    EXPECT_EQ(std::get<Doubles>(parsed(order + "f4", "(2,)", raw<float>({0.5F, -2.0F}, swapped)).values),
              (Doubles{0.5, -2.0}));
    EXPECT_EQ(std::get<Doubles>(parsed(order + "f8", "(2,)", raw<double>({0.1, -2.0}, swapped)).values),
              (Doubles{0.1, -2.0}));
    EXPECT_EQ(std::get<Strings>(parsed(order + "U2", "(2,)", raw<char32_t>({U'a', U'b', U'ß', 0}, swapped)).values),
              (Strings{"ab", "ß"}));
  }
  EXPECT_EQ(std::get<Strings>(parsed("|S3", "(2,)", std::string("abcd\0\0", 6)).values), (Strings{"abc", "d"}));
}

TEST(Npy, ReadsFortranOrder) {
  // [[[0, 1], [2, 3], [4, 5]], [[6, ...], ...]] as (2, 3, 2): value 6 i + 2 j + k stands at i + 2 j + 6 k.
  std::string data;
  for (int k = 0; k < 2; ++k)
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 2; ++i) data += raw<double>({6.0 * i + 2.0 * j + k});
  const NpyArray array = parsed("<f8", "(2, 3, 2)", data, true);
  EXPECT_EQ(std::get<Doubles>(array.values), (Doubles{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}));
  EXPECT_EQ(std::get<Integers>(parsed("<i4", "(4,)", raw<std::int32_t>({1, 2, 3, 4}), true).values),
            (Integers{1, 2, 3, 4}));
}

TEST(Npy, ReadsVersionTwo) {
  std::string bytes = npy_of("<f8", "()", raw<double>({7.0}));
  bytes[6] = 2;
  bytes.insert(10, 2, '\0');
  EXPECT_EQ(std::get<Doubles>(parse_npy(bytes).values), Doubles{7.0});
}

TEST(Npy, RefusesObjectsAndUnknownTypes) {
  EXPECT_SENTENCE(refusal(npy_of("|O", "(1,)", "cos\nsystem\n")));
  EXPECT_THROW(parse_npy(npy_of("|O8", "(1,)", "12345678")), InputError);
  EXPECT_SENTENCE(refusal(npy_of("<c16", "(1,)", std::string(16, ' '))));
  for (const char* type : {"<f2", "<f16", "<i3", "<u16", "|b2", "<M8[ns]", "|V8", "f8", "<f", "", "<f8x", "<f-8",
                           "<U99999999999999999999", "<U2147483648"})
    EXPECT_THROW(parse_npy(npy_of(type, "(1,)", std::string(8, ' '))), InputError) << type;
  EXPECT_SENTENCE(refusal(npy_with("{'descr': [('x', '<f8')], 'fortran_order': False, 'shape': (1,), }", "12345678")));
}

TEST(Npy, RefusesValuesThatAreNotWhatTheyClaim) {
  EXPECT_SENTENCE(refusal(npy_of("<u8", "(1,)", raw<std::uint64_t>({1ULL << 63}))));
  EXPECT_SENTENCE(refusal(npy_of("<U1", "(1,)", raw<std::uint32_t>({0x110000}))));
  EXPECT_SENTENCE(refusal(npy_of("<U1", "(1,)", raw<std::uint32_t>({0xd800}))));
}

TEST(Npy, RefusesSizesThatDoNotMatchOrOverflow) {
  EXPECT_SENTENCE(refusal(npy_of("<f8", "(2, 3)", std::string(47, ' '))));
  EXPECT_THROW(parse_npy(npy_of("<f8", "(2,)", std::string(17, ' '))), InputError);
  EXPECT_SENTENCE(refusal(npy_of("<f8", "(4294967296, 4294967296)", "")));
  for (const char* shape : {"(18446744073709551616,)", "(18446744073709551615, 2)", "(0, 18446744073709551615)",
                            "(65536, 65536, 65536, 65536)", "(134217729,)"})
    EXPECT_THROW(parse_npy(npy_of("<f8", shape, "")), InputError) << shape;
  EXPECT_THROW(parse_npy(npy_of("<U0", "(100000000,)", "")), InputError);  // many strings out of no bytes
}

TEST(Npy, RefusesAnotherGrammar) {
  const std::string data(8, ' ');
  for (const char* dictionary :
       {"", "{", "}", "{}", "{'descr': '<f8', 'fortran_order': False}", "{'descr': '<f8', 'descr': '<f8', 'shape': ()}",
        "{'descr': '<f8', 'fortran_order': 0, 'shape': ()}", "{'descr': '<f8', 'fortran_order': False, 'shape': (1)}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,)}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': [1]}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1,}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1 1)}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': ()} x",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (), 'extra': 1}",
        "{'descr': '<f8, 'fortran_order': False, 'shape': ()}", "{'descr' '<f8', 'fortran_order': False, 'shape': ()}",
        "{'descr': __import__('os').system('x'), 'fortran_order': False, 'shape': ()}"})
    EXPECT_THROW(parse_npy(npy_with(dictionary, data)), InputError) << dictionary;
  std::string deep = "(";
  for (int i = 0; i < 33; ++i) deep += "1, ";
  EXPECT_SENTENCE(refusal(npy_of("<f8", deep + ")", data)));
}

TEST(Npy, RefusesEveryPrefix) {
  const std::string bytes = npy_of("<f8", "(2, 2)", raw<double>({1, 2, 3, 4}));
  ASSERT_NO_THROW(parse_npy(bytes));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(parse_npy(std::string_view(bytes).substr(0, size)), InputError) << size;
  std::string other_version = bytes;
  other_version[6] = 4;
  EXPECT_SENTENCE(refusal(other_version));
  EXPECT_SENTENCE(refusal("PK\x03\x04 something else"));
}

Npz small_archive() {
  Npz npz;
  npz.set("pose", std::vector<double>{0.5, 1.5, 2.5, 3.5, 4.5, 5.5}, {2, 3});
  npz.set("names", std::vector<std::string>{"a", "bc"});
  npz.set_integer("version", 1);
  return npz;
}

TEST(NpzInput, EveryPrefixIsRefused) {
  const std::string bytes = small_archive().bytes();
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(Npz::parse(std::string_view(bytes).substr(0, size), "cut.npz"), InputError) << size;
  EXPECT_SENTENCE(thrown_message<InputError>([&] { Npz::parse(bytes.substr(0, bytes.size() / 2), "cut.npz"); }));
}

// A flipped bit is refused, or hit nothing that is read (a time stamp, a padding space); no value may change.
TEST(NpzInput, AFlippedBitNeverChangesAValue) {
  const std::string bytes = small_archive().bytes();
  const std::vector<double> expected = small_archive().numbers("pose", {2, 3});
  int refused = 0;
  for (std::size_t bit = 0; bit < 8 * bytes.size(); bit += 3) {
    std::string damaged = bytes;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
    try {
      const Npz npz = Npz::parse(damaged, "bad.npz");
      if (npz.contains("pose")) {
        EXPECT_EQ(npz.numbers("pose", {2, 3}), expected) << bit;
      }
    } catch (const InputError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, static_cast<int>(8 * bytes.size() / 3 / 3));
}

TEST(NpzInput, RandomBytesAreRefused) {
  Random random(1, 2);
  for (int i = 0; i < 200; ++i) {
    std::string bytes(static_cast<std::size_t>(random.below(300)), '\0');
    for (char& byte : bytes) byte = static_cast<char>(random.bits());
    if (i % 2 == 0) bytes = npy_of("<f8", "(1,)", "") + bytes;
    EXPECT_THROW(Npz::parse(bytes, "noise.npz"), InputError);
  }
}

TEST(NpzInput, NamesTheEntryAtFault) {
  const auto message = [](const std::vector<ZipEntry>& entries) {
    return thrown_message<InputError>([&] { Npz::parse(zip_bytes(entries), "a.npz"); });
  };
  EXPECT_SENTENCE(message({{"poses.npy", npy_of("|O", "()", "")}}));
  EXPECT_SENTENCE(message({{"readme.txt", "hello"}}));
  EXPECT_SENTENCE(message({{".npy", npy_of("<f8", "(0,)", "")}}));
}

// The directory's claim is enough: nothing is inflated. (Zeros deflate to a thousandth.)
TEST(NpzInput, RefusesArraysThatAreTooLargeTogether) {
  const std::string array = npy_of("<f8", "(1,)", raw<double>({1.0}));
  std::string bytes = zip_bytes({{"a.npy", array}, {"b.npy", array}});
  for (std::size_t at = bytes.find("PK\x01\x02"); at != std::string::npos; at = bytes.find("PK\x01\x02", at + 1))
    bytes.replace(at + 24, 4, raw<std::uint32_t>({600U << 20}));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { Npz::parse(bytes, "bomb.npz"); }));
}

// Strings of no characters take no byte in the file and 32 in memory.
TEST(NpzInput, RefusesEmptyStringsThatAreTooLargeTogether) {
  std::vector<ZipEntry> entries;
  for (int i = 0; i < 9; ++i) entries.push_back({fmt::format("a{}.npy", i), npy_of("|S0", "(4194304,)", "")});
  EXPECT_SENTENCE(thrown_message<InputError>([&] { Npz::parse(zip_bytes(entries), "bomb.npz"); }));
}

TEST(NpzInput, NamesFromTheFileAreShownShort) {
  const std::string bytes = zip_bytes({{std::string(1000, 'x'), ""}});
  EXPECT_EQ(thrown_message<InputError>([&] { Npz::parse(bytes, "a.npz"); }),
            "'a.npz': expected entries named '<key>.npy', found '" + std::string(77, 'x') + "...'");
}

TEST(NpzInput, ABadChecksumIsNamed) {
  std::string bytes = zip_bytes({{"a.npy", npy_of("<f8", "(1,)", raw<double>({1.0}))}});
  const std::size_t central = bytes.find("PK\x01\x02");
  ASSERT_NE(central, std::string::npos);
  bytes[central + 16] = static_cast<char>(bytes[central + 16] ^ 1);  // CRC-32 in the central directory
  EXPECT_SENTENCE(thrown_message<InputError>([&] { Npz::parse(bytes, "a.npz"); }));
}

TEST(NpzInput, AMissingFileIsNamed) {
  EXPECT_SENTENCE(thrown_message<InputError>([] { Npz::load("/nonexistent/a.npz"); }));
}

}  // namespace
}  // namespace duet
