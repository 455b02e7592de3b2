#include "duet/archives/npy/npz.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <limits>

#include "duet/archives/npy/npy.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

Npz some_archive() {
  Npz npz;
  npz.set("positions", std::vector<double>{0.0, 1.5, -2.0, 1e300, -0.0, 5e-324}, {2, 3});
  npz.set("indices", std::vector<std::int64_t>{-1, 0, std::numeric_limits<std::int64_t>::max()}, {3});
  npz.set("names", std::vector<std::string>{"left", "", "Gruß 你好 🙂"});
  npz.set_number("rate_hz", 50.0);
  npz.set_integer("version", 2);
  npz.set_text("task", "hug");
  return npz;
}

Npz reopened(const Npz& npz) { return Npz::parse(npz.bytes(), "a.npz"); }

TEST(Npy, NumbersOfHalfPrecisionAreRead) {
  for (const bool big_endian : {false, true}) {
    std::string header =
        fmt::format("{{'descr': '{}f2', 'fortran_order': False, 'shape': (5,), }}\n", big_endian ? '>' : '<');
    std::string bytes =
        "\x93NUMPY\x01" + std::string(1, '\0') + static_cast<char>(header.size()) + std::string(1, '\0') + header;
    for (const unsigned half : {0x3c00U, 0xc000U, 0x0001U, 0x7bffU, 0x8000U}) {
      const char low = static_cast<char>(half & 0xff), high = static_cast<char>(half >> 8);
      bytes += big_endian ? std::string{high, low} : std::string{low, high};
    }
    EXPECT_EQ(std::get<std::vector<double>>(parse_npy(bytes).values),
              (std::vector<double>{1.0, -2.0, 0x1p-24, 65504.0, 0.0}));
  }
}

TEST(Npz, ANumberIsOneWhateverItsShape) {
  Npz npz;
  npz.set("fps", std::vector<double>{30.0}, {1, 1});
  npz.set("two", std::vector<double>{30.0, 60.0}, {2});
  EXPECT_EQ(npz.number("fps"), 30.0);
  EXPECT_THROW((void)npz.number("two"), InputError);
  EXPECT_EQ(npz.number_or_text("fps"), 30.0);
  npz.set_text("words", "29.97");
  npz.set_text("none", "thirty");
  EXPECT_EQ(npz.number_or_text("words"), 29.97);
  EXPECT_THROW((void)npz.number("words"), InputError);
  EXPECT_THROW((void)npz.number_or_text("none"), InputError);
}

TEST(Npz, ReturnsWhatWasWritten) {
  const Npz npz = reopened(some_archive());
  EXPECT_EQ(npz.keys(), (std::vector<std::string>{"indices", "names", "positions", "rate_hz", "task", "version"}));
  const std::vector<double> positions = npz.numbers("positions", {2, 3});
  EXPECT_EQ(positions, (std::vector<double>{0.0, 1.5, -2.0, 1e300, -0.0, 5e-324}));
  EXPECT_TRUE(std::signbit(positions[4]));
  EXPECT_EQ(npz.integers("indices", {3}), (std::vector<std::int64_t>{-1, 0, std::numeric_limits<std::int64_t>::max()}));
  EXPECT_EQ(npz.strings("names", {-1}), (std::vector<std::string>{"left", "", "Gruß 你好 🙂"}));
  EXPECT_EQ(npz.number("rate_hz"), 50.0);
  EXPECT_EQ(npz.integer("version"), 2);
  EXPECT_EQ(npz.number("version"), 2.0);  // integers are numbers
  EXPECT_EQ(npz.text("task"), "hug");
  EXPECT_TRUE(npz.contains("task"));
  EXPECT_FALSE(npz.contains("tasks"));
}

TEST(Npz, ReturnsTracks) {
  PointTracks tracks(4, 24);
  for (std::size_t i = 0; i < tracks.data().size(); ++i) tracks.data()[i] = 0.1 * static_cast<double>(i);
  Npz npz;
  npz.set("partner", tracks);
  EXPECT_EQ(reopened(npz).tracks("partner", 24), tracks);
  EXPECT_EQ(reopened(npz).tracks("partner", -1), tracks);
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)reopened(npz).tracks("partner", 22); }));
}

TEST(Npz, EmptyArraysAndEmptyArchivesAreKept) {
  Npz npz;
  EXPECT_TRUE(reopened(npz).keys().empty());
  npz.set("contacts", std::vector<double>{}, {0, 3});
  npz.set("messages", std::vector<std::string>{});
  EXPECT_EQ(reopened(npz).array("contacts").shape, (std::vector<std::size_t>{0, 3}));
  EXPECT_TRUE(reopened(npz).strings("messages", {0}).empty());
}

TEST(Npz, SavesToAFile) {
  const test::ScratchFolder folder;
  some_archive().save(folder / "runs/a.npz");
  const Npz npz = Npz::load(folder / "runs/a.npz");
  EXPECT_EQ(npz.name(), folder / "runs/a.npz");
  EXPECT_EQ(npz.bytes(), some_archive().bytes());
}

TEST(Npz, SameArraysGiveTheSameBytesInEveryTimeZone) {
  const std::string bytes = some_archive().bytes();
  setenv("TZ", "Asia/Kathmandu", 1);
  tzset();
  EXPECT_EQ(some_archive().bytes(), bytes);
  unsetenv("TZ");
  tzset();
}

TEST(Npz, OneElementCountsAsScalar) {
  Npz npz;
  npz.set("rate", std::vector<double>{30.0}, {1});
  npz.set("pair", std::vector<double>{1.0, 2.0}, {2});
  npz.set("gender", std::vector<std::string>{"female"});
  EXPECT_EQ(npz.number("rate"), 30.0);
  EXPECT_EQ(npz.text("gender"), "female");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)npz.number("pair"); }));
}

TEST(NpzGetters, NameWhatIsMissingOrOfAnotherKind) {
  const Npz npz = reopened(some_archive());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)npz.number("fps"); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)npz.numbers("positions", {-1, 4}); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)npz.numbers("positions", {6}); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)npz.numbers("names", {3}); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)npz.integers("positions", {2, 3}); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)npz.text("version"); }));
}

TEST(NpzGetters, NameTheFirstIndexThatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  Npz npz;
  npz.set("a", std::vector<double>{0, 1, 2, 3, 4, 5, 6, 7, 8, nan, nan, 11}, {2, 3, 2});
  npz.set("b", std::vector<double>{0, -infinity}, {2});
  npz.set_number("c", nan);
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)reopened(npz).numbers("a", {2, 3, 2}); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)reopened(npz).numbers("b", {2}); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)reopened(npz).number("c"); }));
}

TEST(NpzSet, RefusesWhatCannotBeWritten) {
  Npz npz;
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { npz.set("a", std::vector<double>(5), {2, 3}); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { npz.set_number("", 1.0); }));
  for (const std::string& bad : {std::string("a\0b", 3), std::string("\xff"), std::string("\xc3"),
                                 std::string("\xc0\xaf"), std::string("\xed\xa0\x80"), std::string("\xe0\x80\x80")})
    EXPECT_THROW(npz.set_text("a", bad), std::invalid_argument) << bad;
  EXPECT_TRUE(npz.keys().empty());
}

TEST(Zip, KeepsOrderNamesAndContent) {
  const std::vector<ZipEntry> entries = {{"b", "two"}, {"a/ü", std::string(100000, 'x')}, {"c", ""}};
  std::vector<ZipEntry> found;
  read_zip(zip_bytes(entries), "z", {1 << 20, 1 << 20}, [&](const std::string& entry, const std::string& content) {
    found.push_back({entry, content});
  });
  ASSERT_EQ(found.size(), entries.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].name, entries[i].name);
    EXPECT_EQ(found[i].content, entries[i].content);
  }
}

std::string zip_refusal(const std::vector<ZipEntry>& entries, const ZipLimits& limits) {
  return thrown_message<InputError>(
      [&] { read_zip(zip_bytes(entries), "z", limits, [](const auto&, const auto&) {}); });
}

TEST(Zip, RefusesAnEntryAboveTheLimit) { EXPECT_SENTENCE(zip_refusal({{"a", std::string(1001, 'x')}}, {1000, 10000})); }

TEST(Zip, RefusesEntriesThatAreTooLargeTogether) {
  const std::vector<ZipEntry> three = {{"a", std::string(900, 'x')}, {"b", std::string(900, 'x')}, {"c", "yy"}};
  EXPECT_SENTENCE(zip_refusal(three, {1000, 1800}));
  EXPECT_EQ(zip_refusal(three, {1000, 1802}), "(nothing was thrown)");
}

// The directory at the end says 1 byte where 900 are: what comes out counts.
TEST(Zip, CountsWhatComesOutAndNotOnlyWhatIsClaimed) {
  std::string bytes = zip_bytes({{"a", std::string(900, 'x')}, {"b", std::string(900, 'x')}});
  for (std::size_t at = bytes.find("PK\x01\x02"); at != std::string::npos; at = bytes.find("PK\x01\x02", at + 1))
    bytes.replace(at + 24, 4, std::string("\x01\x00\x00\x00", 4));
  EXPECT_NE(thrown_message<InputError>([&] {
              read_zip(bytes, "z", {1000, 1000}, [](const auto&, const auto&) {});
            }),
            "");
}

TEST(Zip, RefusesAnArchiveOfTooManyEntries) {
  EXPECT_SENTENCE(zip_refusal({{"a", ""}, {"b", ""}, {"c", ""}}, {.entry_bytes = 1, .total_bytes = 1, .entries = 2}));
}

// Both directions against NumPy itself, where python3 has it.

// The first interpreter that has NumPy, "" without one.
std::string python() {
  for (const std::string interpreter : {"python3", "/usr/bin/python3"})
    if (std::system(fmt::format("{} -c 'import numpy' > /dev/null 2>&1", interpreter).c_str()) == 0) return interpreter;
  return "";
}

bool run_python(const std::string& interpreter, const test::ScratchFolder& folder, const std::string& script) {
  write_file(folder / "script.py", "import numpy as np\nimport sys\n" + script);
  return std::system(fmt::format("{} '{}' '{}'", interpreter, folder / "script.py", folder / "a.npz").c_str()) == 0;
}

TEST(NpzAndNumpy, NumpyOpensWhatIsWritten) {
  const std::string interpreter = python();
  if (interpreter.empty()) GTEST_SKIP() << "not run: python3 with numpy absent";
  const test::ScratchFolder folder;
  Npz npz;
  npz.set("x", std::vector<double>{0.1, 1e300, -0.0, std::numeric_limits<double>::quiet_NaN(), 4, 5}, {2, 3});
  npz.set("n", std::vector<std::int64_t>{-(1LL << 62), 7}, {2});
  npz.set("names", std::vector<std::string>{"left", "", "Gruß 你好 🙂"});
  npz.set("empty", std::vector<double>{}, {0, 3});
  npz.set_text("task", "fly_kiss");
  npz.set_number("rate_hz", 50.0);
  npz.save(folder / "a.npz");
  EXPECT_TRUE(run_python(interpreter, folder, R"(
z = np.load(sys.argv[1], allow_pickle=False)
assert sorted(z.files) == ['empty', 'n', 'names', 'rate_hz', 'task', 'x'], z.files
assert z['x'].shape == (2, 3) and z['x'].dtype == np.dtype('<f8')
assert z['x'][0, 0] == 0.1 and z['x'][0, 1] == 1e300 and np.signbit(z['x'][0, 2]) and np.isnan(z['x'][1, 0])
assert z['n'].tolist() == [-(2**62), 7] and z['n'].dtype == np.dtype('<i8')
assert z['names'].tolist() == ['left', '', 'Gruß 你好 🙂']
assert z['empty'].shape == (0, 3)
assert str(z['task']) == 'fly_kiss' and z['task'].shape == ()
assert float(z['rate_hz']) == 50.0
)"));
}

TEST(NpzAndNumpy, WhatNumpyWritesIsRead) {
  const std::string interpreter = python();
  if (interpreter.empty()) GTEST_SKIP() << "not run: python3 with numpy absent";
  for (const char* save : {"savez", "savez_compressed"}) {
    const test::ScratchFolder folder;
    ASSERT_TRUE(run_python(interpreter, folder, R"(
a = np.arange(24.0).reshape(2, 3, 4)
np.)" + std::string(save) + R"((sys.argv[1], c=a, fortran=np.asfortranarray(a), big=a.astype('>f4'), half=a[:, ::2],
  ints=np.array([[-5, 6]], dtype='>i2'), flags=np.array([True, False]), unsigned=np.array(2**63 - 1, dtype='u8'),
  text=np.array('höher'), names=np.array([['a', 'bcd']]), raw=np.array([b'xy', b'z']), scalar=30, real=29.97,
  none=np.zeros((0, 5))))"));
    const Npz npz = Npz::load(folder / "a.npz");
    std::vector<double> counted(24);
    for (int i = 0; i < 24; ++i) counted[static_cast<std::size_t>(i)] = i;
    for (const char* key : {"c", "fortran", "big"}) EXPECT_EQ(npz.numbers(key, {2, 3, 4}), counted) << key;
    EXPECT_EQ(npz.array("half").shape, (std::vector<std::size_t>{2, 2, 4}));
    EXPECT_EQ(npz.integers("ints", {1, 2}), (std::vector<std::int64_t>{-5, 6}));
    EXPECT_EQ(npz.integers("flags", {2}), (std::vector<std::int64_t>{1, 0}));
    EXPECT_EQ(npz.integer("unsigned"), std::numeric_limits<std::int64_t>::max());
    EXPECT_EQ(npz.text("text"), "höher");
    EXPECT_EQ(npz.strings("names", {1, 2}), (std::vector<std::string>{"a", "bcd"}));
    EXPECT_EQ(npz.strings("raw", {2}), (std::vector<std::string>{"xy", "z"}));
    EXPECT_EQ(npz.number("scalar"), 30.0);
    EXPECT_EQ(npz.number("real"), 29.97);
    EXPECT_TRUE(npz.numbers("none", {0, 5}).empty());
  }
}

TEST(NpzAndNumpy, AnObjectArrayIsRefusedAndNotExecuted) {
  const std::string interpreter = python();
  if (interpreter.empty()) GTEST_SKIP() << "not run: python3 with numpy absent";
  const test::ScratchFolder folder;
  ASSERT_TRUE(run_python(interpreter, folder, "np.savez(sys.argv[1], a=np.array([None, {}], dtype=object))\n"));
  EXPECT_EQ(test::thrown_message<std::runtime_error>([&] { Npz::load(folder / "a.npz"); }),
            fmt::format("'{}': array 'a': object arrays ('|O') hold Python code and are not read", folder / "a.npz"));
}

TEST(Deflate, ComesBackWhole) {
  std::string bytes;
  for (const std::size_t size : {0U, 1U, 3U, 70000U}) {
    bytes.resize(size);
    for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>(i * i >> 3);
    EXPECT_EQ(inflated(deflated(bytes), "bytes", 100000), bytes) << size;
  }
  EXPECT_LT(deflated(std::string(70000, 'a')).size(), 200U);
}

// The vectors of RFC 4648.
TEST(Base64, IsTheStandards) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foob"), "Zm9vYg==");
  EXPECT_EQ(base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64(std::string("\xff\xfe\xfd\x00", 4)), "//79AA==");
}

}  // namespace
}  // namespace duet
