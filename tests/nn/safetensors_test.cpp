#include "duet/nn/safetensors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/deep_json.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::ElementsAre;

template <typename T>
std::string bytes_of(std::vector<T> values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

std::string file_of(const std::string& header, const std::string& data) {
  return bytes_of<std::uint64_t>({header.size()}) + header + data;
}

std::string one_tensor(const std::string& type, const std::string& shape, const std::string& data) {
  return file_of(R"({"w":{"dtype":")" + type + R"(","shape":)" + shape + R"(,"data_offsets":[0,)" +
                     std::to_string(data.size()) + "]}}",
                 data);
}

SafeTensors sample() {
  SafeTensors content;
  content.metadata = {{"kind", "student"}, {"note", "a \"quoted\" line\n"}};
  content.tensors["b"] = {{2}, {0.25F, -3.0F}};
  content.tensors["a"] = {{2, 3}, {1.0F, 2.0F, 3.0F, 0.1F, -0.0F, 1e-38F}};
  content.tensors["scalar"] = {{}, {7.0F}};
  content.tensors["empty"] = {{0, 4}, {}};
  return content;
}

std::string refusal(const std::string& bytes) {
  return test::thrown_message<InputError>([&] { parse_safetensors(bytes, "net.safetensors"); });
}

TEST(SafeTensors, WhatIsWrittenIsReadBack) {
  const test::ScratchFolder folder;
  const std::string path = folder / "net.safetensors";
  write_safetensors(path, sample());
  const SafeTensors read = read_safetensors(path);
  EXPECT_EQ(read.metadata, sample().metadata);
  ASSERT_EQ(read.tensors.size(), 4U);
  for (const auto& [name, tensor] : sample().tensors) {
    EXPECT_EQ(read.tensors.at(name).shape, tensor.shape) << name;
    EXPECT_EQ(read.tensors.at(name).values, tensor.values) << name;
  }
}

TEST(SafeTensors, HeaderIsPaddedToEightBytesAndTheBytesRepeat) {
  const std::string bytes = safetensors_bytes(sample());
  std::uint64_t length = 0;
  std::memcpy(&length, bytes.data(), sizeof length);
  EXPECT_EQ(length % 8, 0U);
  EXPECT_EQ(bytes.substr(8 + length).size(), 4 * (2 + 6 + 1));
  EXPECT_EQ(bytes, safetensors_bytes(sample()));
}

TEST(SafeTensors, HalfPrecisionRoundsToNearest) {
  SafeTensors content;
  content.tensors["w"] = {{4}, {1.0F + 0x1p-11F, 65504.0F, 0x1p-24F, -0.1F}};
  const SafeTensors read = parse_safetensors(safetensors_bytes(content, TensorType::kF16), "x");
  EXPECT_THAT(read.tensors.at("w").values, ElementsAre(1.0F, 65504.0F, 0x1p-24F, testing::FloatNear(-0.1F, 0x1p-14F)));
}

TEST(SafeTensors, EveryTypeIsReadAsFloat) {
  const auto read = [](const std::string& type, const std::string& data) {
    return parse_safetensors(one_tensor(type, "[2]", data), "x").tensors.at("w").values;
  };
  EXPECT_THAT(read("F64", bytes_of<double>({0.5, -1e30})), ElementsAre(0.5F, -1e30F));
  EXPECT_THAT(read("F16", bytes_of<std::uint16_t>({0x3C00, 0xC000})), ElementsAre(1.0F, -2.0F));
  EXPECT_THAT(read("I32", bytes_of<std::int32_t>({-7, 1 << 24})), ElementsAre(-7.0F, 16777216.0F));
  EXPECT_THAT(read("I64", bytes_of<std::int64_t>({-(1 << 24), 3})), ElementsAre(-16777216.0F, 3.0F));
}

TEST(SafeTensors, HeadersThatAreNotOnesAreRefused) {
  EXPECT_SENTENCE(refusal(""));
  EXPECT_SENTENCE(refusal(bytes_of<std::uint64_t>({~std::uint64_t{0}})));
  EXPECT_SENTENCE(refusal(file_of("{\"w\":", "")));
  EXPECT_SENTENCE(refusal(file_of("{\"w\":" + test::deep_json() + "}", "")));
  for (const char* text : {"[]", R"({"__metadata__":[]})", R"({"__metadata__":{"a":1}})", R"({"w":3})"})
    EXPECT_SENTENCE(refusal(file_of(text, "")));
}

TEST(SafeTensors, TensorsThatDoNotFitTheBytesAreRefused) {
  const std::string two = bytes_of<float>({1.0F, 2.0F});
  EXPECT_SENTENCE(refusal(one_tensor("F32", "[3]", two)));
  EXPECT_SENTENCE(refusal(one_tensor("F32", "[4294967296,4294967296,2]", two)));
  EXPECT_SENTENCE(refusal(one_tensor("F32", "[-2]", two)));
  EXPECT_SENTENCE(refusal(one_tensor("F32", "[2.0]", two)));
  EXPECT_SENTENCE(refusal(one_tensor("F32", "2", two)));
  EXPECT_SENTENCE(refusal(one_tensor("BF16", "[4]", two)));
  const std::string good = one_tensor("F32", "[2]", two);
  EXPECT_SENTENCE(refusal(good.substr(0, good.size() - 1)));
  EXPECT_SENTENCE(refusal(good + "x"));
  EXPECT_SENTENCE(refusal(file_of(R"({"w":{"dtype":"F32","shape":[],"data_offsets":[0,1,2]}})", two)));
}

TEST(SafeTensors, OverlapsAndGapsAreRefused) {
  const std::string two = bytes_of<float>({1.0F, 2.0F});
  const auto header = [](int begin, int end) {
    return R"({"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]},"b":{"dtype":"F32","shape":[1],"data_offsets":[)" +
           std::to_string(begin) + "," + std::to_string(end) + "]}}";
  };
  EXPECT_EQ(refusal(file_of(header(4, 8), two)), "(nothing was thrown)");
  EXPECT_SENTENCE(refusal(file_of(header(2, 6), two)));
  EXPECT_SENTENCE(refusal(file_of(header(8, 12), two + "1234")));
  EXPECT_SENTENCE(refusal(file_of(header(8, 4), two)));
}

TEST(SafeTensors, NumbersThatFloatDoesNotHoldAreRefused) {
  EXPECT_SENTENCE(refusal(one_tensor("F32", "[2]", bytes_of<float>({1.0F, std::nanf("")}))));
  EXPECT_SENTENCE(refusal(one_tensor("F16", "[1]", bytes_of<std::uint16_t>({0x7C00}))));
  EXPECT_SENTENCE(refusal(one_tensor("F64", "[1]", bytes_of<double>({1e300}))));
  EXPECT_SENTENCE(refusal(one_tensor("I64", "[1]", bytes_of<std::int64_t>({(1 << 24) + 1}))));
}

TEST(SafeTensors, WhatCannotBeStoredIsNotWritten) {
  const auto message = [](const Tensor& tensor, TensorType type, const std::string& name = "w") {
    SafeTensors content;
    content.tensors[name] = tensor;
    return test::thrown_message<std::invalid_argument>([&] { safetensors_bytes(content, type); });
  };
  EXPECT_SENTENCE(message({{3}, {1.0F}}, TensorType::kF32));
  EXPECT_SENTENCE(message({{-1}, {1.0F}}, TensorType::kF32));
  EXPECT_SENTENCE(message({{1}, {65520.0F}}, TensorType::kF16));
  EXPECT_SENTENCE(message({{1}, {std::numeric_limits<float>::infinity()}}, TensorType::kF32));
  EXPECT_SENTENCE(message({{1}, {1.0F}}, TensorType::kF32, "__metadata__"));
  EXPECT_SENTENCE(message({{1}, {1.0F}}, TensorType::kF32, "\xff"));
}

TEST(SafeTensors, AFolderThatCannotBeWrittenIsNamed) {
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { write_safetensors("/proc/none/net", sample()); }));
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { read_safetensors("/proc/none/net"); }));
}

}  // namespace
}  // namespace duet
