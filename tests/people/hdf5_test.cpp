// HDF5: what the library itself has written (tests/archives/hdf5, by HDF5 1.10.8) is read back, each form or with a
// sentence that names it; damage is refused, and takes no memory.
#include "duet/people/hdf5/hdf5.h"

#include <gmock/gmock.h>

#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "tests/archives/hdf5_bytes.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::Hdf5Writer;
using test::ScratchFolder;
using test::thrown_message;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string library_file(const std::string& name) { return DUET_SOURCE_DIR "/tests/archives/hdf5/" + name + ".h5"; }

std::vector<double> values_of(const NpyArray& array) { return std::get<std::vector<double>>(array.values); }

// The values that the library was given: (4, 5, 3).
std::vector<double> library_values() {
  std::vector<double> values;
  for (int i = 0; i < 60; ++i) values.push_back(0.25 * i - 3.0);
  return values;
}

void expect_library_array(const std::string& file, const std::string& name) {
  const NpyArray array = Hdf5File(library_file(file)).array(name);
  EXPECT_THAT(array.shape, ElementsAre(4, 5, 3)) << file << " " << name;
  EXPECT_EQ(values_of(array), library_values()) << file << " " << name;
}

// Chunks are of (3, 2, 3): those at the edges are not full.
TEST(Hdf5, WhatTheLibraryWritesIsRead) {
  for (const char* name : {"plain", "double_big", "chunks", "deflated", "all_filters", "compact"})
    expect_library_array("library", name);
  for (const char* name : {"plain", "deflated", "compact"}) expect_library_array("library_18", name);
  for (const char* name : {"plain", "compact"}) expect_library_array("library_latest", name);
}

TEST(Hdf5, NamesAreThoseOfTheRootGroup) {
  EXPECT_THAT(Hdf5File(library_file("library")).names(),
              ElementsAre("all_filters", "chunks", "compact", "deflated", "double_big", "group", "integers", "link",
                          "plain", "unwritten"));
  EXPECT_THAT(Hdf5File(library_file("library_18")).names(), ElementsAre("plain", "compact", "deflated"));
}

TEST(Hdf5, WhatIsNotReadIsRefusedByName) {
  const auto refusal = [](const std::string& file, const std::string& name) {
    return thrown_message<InputError>([&] { (void)Hdf5File(library_file(file)).array(name); });
  };
  EXPECT_SENTENCE(refusal("library", "integers"));
  EXPECT_SENTENCE(refusal("library", "group"));
  EXPECT_SENTENCE(refusal("library", "link"));
  EXPECT_SENTENCE(refusal("library", "unwritten"));
  EXPECT_SENTENCE(refusal("library", "none"));
  EXPECT_SENTENCE(refusal("library_latest", "deflated"));
  EXPECT_SENTENCE(refusal("library_dense", "clip00"));
}

std::vector<test::Hdf5TestArray> many_arrays(int count) {
  std::vector<test::Hdf5TestArray> arrays;
  for (int i = 0; i < count; ++i)
    arrays.push_back({.name = "clip" + std::to_string(10'000 + 7 * i), .shape = {1}, .values = {1.0 * i}});
  return arrays;
}

// Trees of one to eight levels, with leaves that are full and not; names that are not there lie before, between, after.
TEST(Hdf5, EveryNameOfADeepTreeIsFound) {
  const ScratchFolder folder;
  for (const auto& [count, leaf, children] : {std::tuple{1, 8, 32}, {8, 8, 32}, {9, 8, 32}, {100, 1, 2}, {77, 3, 3}}) {
    const std::vector<test::Hdf5TestArray> arrays = many_arrays(count);
    write_file(folder / "tree.h5", Hdf5Writer::bytes(arrays, {.names_in_leaf = static_cast<std::size_t>(leaf),
                                                              .children_of_node = static_cast<std::size_t>(children)}));
    Hdf5File file(folder / "tree.h5");
    EXPECT_EQ(file.names().size(), arrays.size());
    for (const test::Hdf5TestArray& array : arrays) EXPECT_EQ(values_of(file.array(array.name)), array.values);
    for (const char* none : {"", "clip", "clip10003", "clip99999", "zzz"})
      EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)file.array(none); }));
  }
  write_file(folder / "empty.h5", Hdf5Writer::bytes({}));
  EXPECT_TRUE(Hdf5File(folder / "empty.h5").names().empty());
}

TEST(Hdf5, FilesOfOtherKindsAndTruncatedOnesAreRefused) {
  const ScratchFolder folder;
  const auto refusal = [&](const std::string& bytes) {
    write_file(folder / "x.h5", bytes);
    return thrown_message<InputError>([&] { (void)Hdf5File(folder / "x.h5").array("plain"); });
  };
  const std::string good = read_file(library_file("library"));
  EXPECT_SENTENCE(refusal(""));
  EXPECT_SENTENCE(refusal(std::string(100, 'x')));
  for (const std::size_t size : {std::size_t{48}, std::size_t{100}, good.size() / 2, good.size() - 1})
    EXPECT_THAT(refusal(good.substr(0, size)), HasSubstr("x.h5'")) << size;
  EXPECT_SENTENCE(refusal(good.substr(0, good.size() - 1)));
  std::string narrow = good;
  narrow[13] = 4;
  EXPECT_SENTENCE(refusal(narrow));
  std::string later = good;
  later[8] = 9;
  EXPECT_SENTENCE(refusal(later));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)Hdf5File(folder / "none.h5"); }));
}

// A header that promises more than the file holds takes no memory.
TEST(Hdf5, HugeHeadersAreRefused) {
  const ScratchFolder folder;
  const auto refusal = [&](const std::vector<std::uint64_t>& shape) {
    write_file(folder / "x.h5", Hdf5Writer::bytes({{.name = "x", .shape = shape, .values = {1.0, 2.0}}}));
    return thrown_message<InputError>([&] { (void)Hdf5File(folder / "x.h5").array("x"); });
  };
  EXPECT_SENTENCE(refusal({1'000'000, 56, 6}));
  EXPECT_SENTENCE(refusal({std::uint64_t{1} << 62, 8}));
  EXPECT_SENTENCE(refusal({100'000, 56, 6}));
  // A chunked array whose shape says more than its chunks hold.
  std::string bytes = read_file(library_file("library"));
  const std::string shape("\x04\0\0\0\0\0\0\0\x05\0\0\0\0\0\0\0\x03\0\0\0\0\0\0\0", 24);
  for (std::size_t at = bytes.find(shape); at != std::string::npos; at = bytes.find(shape, at + 1)) bytes[at + 2] = 16;
  write_file(folder / "x.h5", bytes);
  for (const char* name : {"deflated", "chunks"})
    EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)Hdf5File(folder / "x.h5").array(name); }));
}

TEST(Hdf5, DamageIsReadOrRefusedWithASentence) {
  const ScratchFolder folder;
  const std::string good = read_file(library_file("library"));
  Random random(17, 1);
  int refused = 0;
  for (int i = 0; i < 600; ++i) {
    std::string bytes = good;
    for (int k = 0; k <= i % 4; ++k)
      bytes[static_cast<std::size_t>(random.below(static_cast<int>(bytes.size())))] = static_cast<char>(random.bits());
    write_file(folder / "x.h5", bytes, Durability::kUnsynced);
    try {
      Hdf5File file(folder / "x.h5");
      for (const std::string& name : file.names()) {
        try {
          (void)file.array(name);
        } catch (const InputError& error) {
          EXPECT_THAT(error.what(), HasSubstr("x.h5'"));
        }
      }
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("x.h5'"));
      ++refused;
    }
  }
  EXPECT_GT(refused, 10);
}

}  // namespace
}  // namespace duet
