#include <gmock/gmock.h>

#include <functional>

#include "duet/archives/zip/zip.h"
#include "duet/core/require.h"
#include "duet/people/bodies/number_table.h"
#include "tests/archives/torch_bytes.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::PickleWriter;
using test::thrown_message;
using test::TorchWriter;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<double> read_x(const TorchWriter& writer) {
  const TorchFile file = parse_torch(writer.str(), "x.pt");
  return tensor_values(file, *file.pickle.find(file.pickle[file.pickle.root], "x"), "tensor 'x'");
}

TorchWriter dict_of(const std::function<void(TorchWriter&)>& tensor) {
  TorchWriter writer;
  writer.pickle.raw("}(").text("x");
  tensor(writer);
  writer.pickle.raw("u.");
  return writer;
}

std::string refusal(const TorchWriter& writer) {
  return thrown_message<InputError>([&] { (void)read_x(writer); });
}

TEST(TorchTensors, AnyStridesGiveTheSameNumbers) {
  for (const bool transposed : {false, true})
    EXPECT_THAT(read_x(dict_of([&](TorchWriter& out) {
                  out.floats(2, 3, {1, 2, 3, 4, 5, 6}, transposed);
                })),
                ElementsAre(1, 2, 3, 4, 5, 6));
  const std::string six = PickleWriter::packed({1, 2, 3, 4, 5, 6});
  EXPECT_THAT(read_x(dict_of([&](TorchWriter& out) { out.tensor("DoubleStorage", six, 6, 1, {2}, {3}); })),
              ElementsAre(2, 5));
  EXPECT_THAT(read_x(dict_of([&](TorchWriter& out) { out.tensor("DoubleStorage", six, 6, 2, {3}, {0}); })),
              ElementsAre(3, 3, 3));
  EXPECT_THAT(read_x(dict_of([&](TorchWriter& out) { out.tensor("DoubleStorage", six, 6, 5, {}, {}); })),
              ElementsAre(6));
  EXPECT_THAT(read_x(dict_of([&](TorchWriter& out) {
                out.tensor("DoubleStorage", "", 0, 0, {0, 3}, {3, 1});
              })),
              ElementsAre());
}

TEST(TorchTensors, TypesOfNumbersAreRead) {
  using namespace std::string_literals;
  const auto two = [](const std::string& storage, const std::string& bytes) {
    return read_x(dict_of([&](TorchWriter& out) { out.tensor(storage, bytes, 2, 0, {2}, {1}); }));
  };
  EXPECT_THAT(two("HalfStorage", "\x00\x3c\x00\xc1"s), ElementsAre(1.0, -2.5));
  EXPECT_THAT(two("HalfStorage", "\x01\x00\xff\x7b"s), ElementsAre(0x1p-24, 65504.0));
  EXPECT_THAT(two("LongStorage", "\x07\0\0\0\0\0\0\0\xff\xff\xff\xff\xff\xff\xff\xff"s), ElementsAre(7, -1));
  EXPECT_THAT(two("IntStorage", "\x07\0\0\0\xfe\xff\xff\xff"s), ElementsAre(7, -2));
  EXPECT_THAT(two("BoolStorage", "\x01\0"s), ElementsAre(1, 0));
}

TEST(TorchTensors, WhatDoesNotLieInTheStorageIsRefused) {
  const std::string six = PickleWriter::packed({1, 2, 3, 4, 5, 6});
  const auto lie = [&](int first, const std::vector<int>& sizes, const std::vector<int>& strides) {
    return refusal(dict_of([&](TorchWriter& out) { out.tensor("DoubleStorage", six, 6, first, sizes, strides); }));
  };
  EXPECT_SENTENCE(lie(0, {2, 3}, {3, 2}));
  EXPECT_SENTENCE(lie(6, {1}, {1}));
  EXPECT_SENTENCE(lie(0, {1 << 30, 1 << 30, 1 << 30}, {0, 0, 0}));
  EXPECT_SENTENCE(lie(0, {1 << 30}, {0}));
  EXPECT_SENTENCE(lie(0, {2}, {-1}));
  EXPECT_SENTENCE(lie(0, {2}, {1, 1}));
}

TEST(TorchTensors, OtherFilesAndNamesAreRefused) {
  const auto file = [](const std::string& bytes) {
    return thrown_message<InputError>([&] { (void)parse_torch(bytes, "x.pt"); });
  };
  EXPECT_SENTENCE(file(""));
  EXPECT_SENTENCE(file("\x80\x02N."));
  EXPECT_SENTENCE(file(zip_bytes({{"a/version", "3"}})));
  EXPECT_SENTENCE(file(zip_bytes({{"a/data.pkl", "\x80\x02N."}, {"a/byteorder", "big"}})));
  EXPECT_SENTENCE(file(zip_bytes({{"a/data.pkl",
                                   "\x80\x02"
                                   "cos\nsystem\n."}})));
  EXPECT_SENTENCE(file(zip_bytes({{"a/data.pkl",
                                   "\x80\x02"
                                   "ctorch._utils\n_rebuild_tensor_v2\n)R."}})));
  EXPECT_SENTENCE(refusal(dict_of([](TorchWriter& out) { out.tensor("QInt8Storage", "a", 1, 0, {1}, {1}); })));
  EXPECT_SENTENCE(refusal(dict_of([](TorchWriter& out) { out.pickle.integer(3); })));
}

TEST(TorchTensors, TruncatedAnywhereIsRefused) {
  const std::string good = dict_of([](TorchWriter& out) { out.floats(1, 2, {1, 2}); }).str();
  for (std::size_t size = 0; size < good.size(); size += 7)
    EXPECT_THAT(thrown_message<InputError>([&] { (void)parse_torch(good.substr(0, size), "x.pt"); }),
                HasSubstr("'x.pt"));
}

}  // namespace
}  // namespace duet
