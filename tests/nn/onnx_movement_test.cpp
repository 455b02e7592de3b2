#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "tests/nn/evaluate.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet::test {
namespace {

using ::testing::ElementsAre;
using ::testing::ElementsAreArray;

using Whole = std::vector<std::int64_t>;

// 0, 1, 2, ...: each number says where it came from.
Operand counted(const Shape& shape) {
  Operand x{shape, {}};
  x.values.resize(std::accumulate(shape.begin(), shape.end(), std::int64_t{1}, std::multiplies<>()));
  std::iota(x.values.begin(), x.values.end(), 0.0F);
  return x;
}

// The result of a node on a counted tensor and whole numbers that the file fixes; once as input, once as constant.
std::vector<float> moved(const std::string& op, const Shape& shape, const std::vector<Whole>& fixed,
                         const Attributes& attributes = {}, int opset = 13) {
  std::vector<std::vector<float>> results;
  for (const bool constant : {false, true}) {
    OnnxWriter writer(opset);
    const Operand x = counted(shape);
    std::vector<std::string> names = {"x"};
    if (constant)
      writer.constant("x", shape, x.values);
    else
      writer.input("x", shape);
    for (const Whole& numbers : fixed) {
      names.push_back("fixed" + std::to_string(names.size()));
      writer.whole(names.back(), numbers);
    }
    writer.node(op, names, {"y"}, attributes).output("y");
    std::vector<std::vector<float>> inputs;
    if (!constant) inputs.push_back(x.values);
    results.push_back(evaluate(*writer.network(), inputs)[0]);
  }
  EXPECT_EQ(results[0], results[1]) << op;
  return results[0];
}

TEST(OnnxMovement, SliceTakesStartsEndsAxesAndSteps) {
  constexpr std::int64_t kEnd = std::numeric_limits<std::int64_t>::max();
  EXPECT_THAT(moved("Slice", {2, 4}, {{1}, {3}, {1}}), ElementsAre(1, 2, 5, 6));
  EXPECT_THAT(moved("Slice", {2, 4}, {{1}, {2}}), ElementsAre(4, 5, 6, 7));
  EXPECT_THAT(moved("Slice", {2, 4}, {{-2}, {kEnd}, {-1}, {1}}), ElementsAre(2, 3, 6, 7));
  EXPECT_THAT(moved("Slice", {2, 4}, {{0}, {kEnd}, {1}, {2}}), ElementsAre(0, 2, 4, 6));
  EXPECT_THAT(moved("Slice", {2, 4}, {{-1}, {-kEnd}, {1}, {-1}}), ElementsAre(3, 2, 1, 0, 7, 6, 5, 4));
  EXPECT_THAT(moved("Slice", {2, 4}, {{0, 1}, {1, 4}, {0, 1}}, {}, 11), ElementsAre(1, 2, 3));
  EXPECT_THAT(moved("Slice", {2, 4}, {{3}, {1}, {1}}), ElementsAre());
  EXPECT_THAT(moved("Slice", {5}, {{-100}, {100}, {0}, {kEnd}}), ElementsAre(0));
}

TEST(OnnxMovement, TransposeReversesOrPermutes) {
  EXPECT_THAT(moved("Transpose", {2, 3}, {}), ElementsAre(0, 3, 1, 4, 2, 5));
  EXPECT_THAT(moved("Transpose", {1, 2, 3}, {}, {{"perm", Whole{0, 2, 1}}}), ElementsAre(0, 3, 1, 4, 2, 5));
  EXPECT_THAT(moved("Transpose", {2, 2, 2}, {}, {{"perm", Whole{2, 0, 1}}}), ElementsAre(0, 2, 4, 6, 1, 3, 5, 7));
}

TEST(OnnxMovement, GatherPicksRowsAndColumns) {
  EXPECT_THAT(moved("Gather", {3, 2}, {{2, 0}}), ElementsAre(4, 5, 0, 1));
  EXPECT_THAT(moved("Gather", {2, 3}, {{-1}}, {{"axis", std::int64_t{1}}}), ElementsAre(2, 5));
}

TEST(OnnxMovement, ExpandStretchesBothWays) {
  EXPECT_THAT(moved("Expand", {2, 1}, {{2, 3}}), ElementsAre(0, 0, 0, 1, 1, 1));
  EXPECT_THAT(moved("Expand", {2}, {{2, 1}}), ElementsAre(0, 1, 0, 1));
  EXPECT_THAT(moved("Expand", {3, 1}, {{1}}), ElementsAre(0, 1, 2));
}

TEST(OnnxMovement, ReshapesKeepTheOrder) {
  const std::vector<float> order = counted({2, 3, 4}).values;
  EXPECT_EQ(moved("Reshape", {2, 3, 4}, {{0, -1}}), order);
  EXPECT_EQ(moved("Reshape", {2, 3, 4}, {{24}}, {}, 11), order);
  EXPECT_EQ(moved("Flatten", {2, 3, 4}, {}, {{"axis", std::int64_t{-1}}}), order);
  EXPECT_EQ(moved("Squeeze", {2, 1, 3}, {{1}}), counted({6}).values);
  EXPECT_EQ(moved("Squeeze", {2, 1, 3}, {}, {{"axes", Whole{-2}}}, 11), counted({6}).values);
  EXPECT_EQ(moved("Unsqueeze", {2, 3}, {{0, -1}}), counted({6}).values);
  EXPECT_EQ(moved("Unsqueeze", {2, 3}, {}, {{"axes", Whole{0, 3}}}, 12), counted({6}).values);
}

TEST(OnnxMovement, ShapesAfterReshapesAreThoseOfTheStandard) {
  // The sum over what is stated as the last axis tells where the sizes went.
  OnnxWriter writer;
  writer.input("x", {2, 1, 3}).whole("axes", {1}).node("Squeeze", {"x", "axes"}, {"s"}).node("Shape", {"s"}, {"y"});
  writer.node("Cast", {"y"}, {"z"}, {{"to", std::int64_t{1}}}).output("z");
  EXPECT_THAT(evaluate(*writer.network(), {counted({6}).values})[0], ElementsAre(2, 3));
}

TEST(OnnxMovement, ConcatJoinsAlongAnyAxis) {
  const Operand a{{2, 1}, {0, 1}}, b{{2, 2}, {2, 3, 4, 5}};
  expect_node("Concat", {a, b}, {0, 2, 3, 1, 4, 5}, {{"axis", std::int64_t{1}}});
  expect_node("Concat", {a, a}, {0, 1, 0, 1}, {{"axis", std::int64_t{-2}}});
  expect_node("Concat", {a}, {0, 1}, {{"axis", std::int64_t{0}}});
  expect_node("Concat", {{{2}, {6, 7}}, {{1}, {8}}}, {6, 7, 8}, {{"axis", std::int64_t{0}}});  // as lists of numbers
}

std::vector<std::vector<float>> parts(int opset, const Attributes& attributes, const Whole& sizes) {
  OnnxWriter writer(opset);
  std::vector<std::string> names = {"x"};
  if (!sizes.empty()) {
    writer.whole("sizes", sizes);
    names.emplace_back("sizes");
  }
  writer.input("x", {2, 4}).node("Split", names, {"a", "b"}, attributes).output("a").output("b");
  return evaluate(*writer.network(), {counted({8}).values});
}

TEST(OnnxMovement, SplitTakesSizesAsAttributeThenAsInput) {
  const auto equal = ElementsAre(ElementsAre(0, 1, 4, 5), ElementsAre(2, 3, 6, 7));
  const auto uneven = ElementsAre(ElementsAre(0, 4), ElementsAre(1, 2, 3, 5, 6, 7));
  const Attributes last = {{"axis", std::int64_t{-1}}};
  EXPECT_THAT(parts(11, last, {}), equal);
  EXPECT_THAT(parts(13, last, {}), equal);
  EXPECT_THAT(parts(12, {{"axis", std::int64_t{1}}, {"split", Whole{1, 3}}}, {}), uneven);
  EXPECT_THAT(parts(13, last, {1, 3}), uneven);
}

TEST(OnnxMovement, SplitTakesTheNumberOfPartsFromOperatorSet18) {
  const Attributes two = {{"axis", std::int64_t{1}}, {"num_outputs", std::int64_t{2}}};
  EXPECT_THAT(parts(18, two, {}), ElementsAre(ElementsAre(0, 1, 4, 5), ElementsAre(2, 3, 6, 7)));
  EXPECT_THAT(parts(18, {{"axis", std::int64_t{1}}}, {1, 3}),
              ElementsAre(ElementsAre(0, 4), ElementsAre(1, 2, 3, 5, 6, 7)));
  OnnxWriter uneven(18);  // the last part is the smaller one
  uneven.input("x", {5}).node("Split", {"x"}, {"a", "b"}, {{"num_outputs", std::int64_t{2}}}).output("a").output("b");
  EXPECT_THAT(evaluate(*uneven.network(), {counted({5}).values}), ElementsAre(ElementsAre(0, 1, 2), ElementsAre(3, 4)));
}

TEST(OnnxMovement, SplitInOperatorSet18RefusesWhatDoesNotSayItsParts) {
  const auto refusal = [](const Attributes& attributes, std::int64_t size, int outputs) {
    OnnxWriter writer(18);
    std::vector<std::string> names;
    for (int i = 0; i < outputs; ++i) names.push_back("out" + std::to_string(i));
    writer.input("x", {size}).node("Split", {"x"}, names, attributes);
    for (const std::string& name : names) writer.output(name);
    return writer.refusal();
  };
  const auto count = [](std::int64_t parts) { return Attributes{{"num_outputs", parts}}; };
  EXPECT_SENTENCE(refusal({}, 4, 2));
  EXPECT_SENTENCE(refusal(count(3), 4, 2));
  EXPECT_SENTENCE(refusal(count(4), 5, 4));
}

// PyTorch's way to write x.reshape(batch, -1): the batch is taken from the shape of the input.
TEST(OnnxMovement, ShapeArithmeticIsFoldedInEveryOperatorSet) {
  for (const int opset : {11, 13}) {
    OnnxWriter writer(opset);
    writer.input("x", {-1, 2, 3}).node("Shape", {"x"}, {"shape"});
    writer.node("Constant", {}, {"zero"}, {{"value", OnnxTensor{ElementType::kInteger, {}, {}, {0}}}});
    writer.node("Gather", {"shape", "zero"}, {"batch"});
    if (opset < 13)
      writer.node("Unsqueeze", {"batch"}, {"first"}, {{"axes", Whole{0}}});
    else
      writer.whole("axes", {0}).node("Unsqueeze", {"batch", "axes"}, {"first"});
    writer.whole("rest", {-1}).node("Concat", {"first", "rest"}, {"target"}, {{"axis", std::int64_t{0}}});
    writer.node("Reshape", {"x", "target"}, {"y"}).output("y", {-1, 6});
    EXPECT_EQ(evaluate(*writer.network(), {counted({6}).values})[0], counted({6}).values);
  }
}

// PyTorch's way to write x.expand(-1, 3): sizes of -1 are replaced before Expand.
TEST(OnnxMovement, ExpandOfPyTorchIsFolded) {
  OnnxWriter writer;
  const OnnxTensor one{ElementType::kInteger, {1}, {}, {1}};
  writer.input("x", {-1, 1}).whole("sizes", {-1, 3}).whole("two", {2}).whole("minus", {-1});
  writer.node("ConstantOfShape", {"two"}, {"ones"}, {{"value", one}});
  writer.node("Mul", {"ones", "minus"}, {"open"}).node("Equal", {"sizes", "open"}, {"is_open"});
  writer.node("Where", {"is_open", "ones", "sizes"}, {"target"}).node("Expand", {"x", "target"}, {"y"}).output("y");
  EXPECT_THAT(evaluate(*writer.network(), {{5.0F}})[0], ElementsAre(5, 5, 5));
}

TEST(OnnxMovement, WholeNumbersAreComputedExactly) {
  OnnxWriter writer;
  const std::int64_t large = (std::int64_t{1} << 40) + 1;
  writer.whole("a", {large, -7, 7}).whole("b", {large - 2, 2, -2});
  writer.node("Sub", {"a", "b"}, {"difference"}).node("Div", {"a", "b"}, {"quotient"});
  writer.node("Max", {"difference", "quotient"}, {"most"});
  writer.node("Cast", {"most"}, {"y"}, {{"to", std::int64_t{1}}}).output("y");
  EXPECT_THAT(evaluate(*writer.network(), {})[0], ElementsAre(2, -3, 9));
}

// A reference motion in the file, its frame picked by an input: what whole-body trackers are exported as.
TEST(OnnxMovement, RowsArePickedByTheInput) {
  OnnxWriter writer;
  writer.input("time", {1, 1}).constant("frames", {3, 2}, {0, 1, 10, 11, 20, 21});
  writer.node("Cast", {"time"}, {"step"}, {{"to", std::int64_t{7}}}).whole("axes", {1});
  writer.node("Squeeze", {"step", "axes"}, {"index"}).node("Gather", {"frames", "index"}, {"y"}).output("y", {1, 2});
  const auto network = writer.network();
  EXPECT_THAT(evaluate(*network, {{1.9F}})[0], ElementsAre(10, 11));
  EXPECT_THAT(evaluate(*network, {{-1.0F}})[0], ElementsAre(20, 21));
  for (const float outside : {3.0F, -4.0F, 1e30F, std::nanf("")})
    EXPECT_TRUE(std::isnan(evaluate(*network, {{outside}})[0][0])) << outside;
}

std::string refusal(const std::string& op, const Shape& shape, const std::vector<Whole>& fixed,
                    const Attributes& attributes = {}, int opset = 13) {
  OnnxWriter writer(opset);
  std::vector<std::string> names = {"x"};
  for (const Whole& numbers : fixed) {
    names.push_back("fixed" + std::to_string(names.size()));
    writer.whole(names.back(), numbers);
  }
  return writer.input("x", shape).node(op, names, {"y"}, attributes).output("y").refusal();
}

TEST(OnnxMovement, MisfitsAreRefused) {
  const std::string slice = "'test.onnx': node 'Slice#0', operator Slice: ";
  EXPECT_EQ(refusal("Slice", {4}, {{0}, {1}, {1}}), slice + "expected an axis of a tensor of rank 1, found 1");
  EXPECT_EQ(refusal("Slice", {4}, {{0}, {1}, {0}, {0}}), slice + "expected steps that are not 0");
  EXPECT_EQ(refusal("Slice", {4}, {{0}, {1, 2}}), slice + "expected as many starts as ends, axes and steps");
  EXPECT_SENTENCE(refusal("Reshape", {4}, {{3}}));
  EXPECT_SENTENCE(refusal("Reshape", {4}, {{3, -1}}));
  EXPECT_SENTENCE(refusal("Reshape", {4}, {{-1, -1}}));
  EXPECT_SENTENCE(refusal("Transpose", {2, 2}, {}, {{"perm", Whole{0, 0}}}));
  EXPECT_SENTENCE(refusal("Gather", {3}, {{3}}));
  EXPECT_SENTENCE(refusal("Expand", {2}, {{3}}));
  EXPECT_SENTENCE(refusal("Expand", {1}, {{1 << 30}}));
  EXPECT_SENTENCE(refusal("Squeeze", {2}, {{0}}));
  EXPECT_SENTENCE(refusal("Squeeze", {1}, {{0}}, {}, 11));
  EXPECT_SENTENCE(refusal("Unsqueeze", {1}, {}, {{"axes", Whole{0}}}, 13));
  EXPECT_SENTENCE(refusal("Split", {4}, {{1}}));
  EXPECT_SENTENCE(refusal("Cast", {4}, {}, {{"to", std::int64_t{10}}}));
  EXPECT_SENTENCE(refusal("ConstantOfShape", {4}, {}));
}

}  // namespace
}  // namespace duet::test
