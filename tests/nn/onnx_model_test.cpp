#include "duet/nn/onnx/onnx_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <onnx/onnx_pb.h>

#include <cmath>
#include <functional>
#include <limits>

#include "duet/core/require.h"
#include "tests/backends/allocation_count.h"
#include "tests/nn/evaluate.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// y = W x of two numbers, as a place for what is wrong.
void fill_small(OnnxWriter& writer) {
  writer.input("x", {-1, 2}).constant("W", {2, 1}, {2.0F, 3.0F}).node("MatMul", {"x", "W"}, {"y"}).output("y", {-1, 1});
}

std::string refusal(const std::function<void(onnx::ModelProto&)>& spoil) {
  OnnxWriter writer;
  fill_small(writer);
  spoil(writer.model());
  return writer.refusal();
}

TEST(OnnxModel, PortsHaveTheirNamesAndSizesWithAnOpenBatchOf1) {
  OnnxWriter writer;
  fill_small(writer);
  const auto network = writer.network();
  ASSERT_EQ(network->inputs().size(), 1U);
  EXPECT_EQ(network->inputs()[0].name, "x");
  EXPECT_EQ(network->inputs()[0].size, 2);
  EXPECT_EQ(network->outputs()[0].name, "y");
  EXPECT_EQ(network->outputs()[0].size, 1);
  EXPECT_THAT(evaluate(*network, {{10.0F, 1.0F}})[0], ElementsAre(23.0F));
}

TEST(OnnxModel, ConstantsMayStandAmongTheInputsAndInAnyType) {
  OnnxWriter writer;
  writer.input("x", {1}).input("c", {1}).output("y").node("Mul", {"x", "c"}, {"y"});
  auto& constant = *writer.model().mutable_graph()->add_initializer();
  constant.set_name("c");
  constant.add_dims(1);
  constant.set_data_type(onnx::TensorProto::DOUBLE);
  constant.add_double_data(2.5);
  EXPECT_THAT(evaluate(*writer.network(), {{2.0F}})[0], ElementsAre(5.0F));
  constant.clear_double_data();
  constant.set_data_type(onnx::TensorProto::FLOAT16);
  constant.add_int32_data(0x3E00);
  EXPECT_THAT(evaluate(*writer.network(), {{2.0F}})[0], ElementsAre(3.0F));
}

TEST(OnnxModel, AnOutputMayBeAnInputOrAConstant) {
  OnnxWriter writer;
  writer.input("x", {2}).constant("c", {1}, {7.0F}).node("Identity", {"x"}, {"y"}).output("y").output("c").output("x");
  EXPECT_THAT(evaluate(*writer.network(), {{1.0F, 2.0F}}),
              ElementsAre(ElementsAre(1.0F, 2.0F), ElementsAre(7.0F), ElementsAre(1.0F, 2.0F)));
}

TEST(OnnxModel, NothingAllocatesInRun) {
  if (!allocations_are_counted()) GTEST_SKIP() << "not run: a counting malloc is absent";
  OnnxWriter writer;
  const std::vector<float> W = operand({8, 300}).values;
  writer.input("x", {1, 300}).constant("W", {8, 300}, W).constant("k", {2, 1, 3}, operand({2, 1, 3}).values);
  writer.node("Gemm", {"x", "W"}, {"a"}, {{"transB", std::int64_t{1}}}).whole("shape", {1, 1, 8}).whole("last", {-1});
  writer.node("Elu", {"a"}, {"b"}).node("Reshape", {"b", "shape"}, {"c"}).node("Conv", {"c", "k"}, {"d"});
  writer.node("Transpose", {"d"}, {"e"}).node("Softmax", {"e"}, {"f"}).node("ReduceSum", {"f", "last"}, {"g"});
  writer.node("Add", {"e", "g"}, {"h"}).node("Concat", {"f", "h"}, {"y"}, {{"axis", std::int64_t{0}}});
  const auto network = writer.output("y").network();
  const std::vector<float> x = wave(300);
  std::vector<float> y(network->outputs()[0].size);
  const std::span<const float> inputs[] = {x};
  const std::span<float> outputs[] = {y};
  const long before = allocation_count();
  network->run(inputs, outputs);
  EXPECT_EQ(allocation_count() - before, 0);
}

TEST(OnnxModel, UnknownOperatorsAreRefusedByName) {
  const auto renamed = [](const std::string& op, const std::string& domain) {
    return refusal([&](onnx::ModelProto& model) {
      model.mutable_graph()->mutable_node(0)->set_op_type(op);
      model.mutable_graph()->mutable_node(0)->set_domain(domain);
      model.mutable_graph()->mutable_node(0)->set_name("/actor/0");
    });
  };
  EXPECT_EQ(renamed("Einsum", ""), "'test.onnx': node '/actor/0', operator Einsum: not supported");
  EXPECT_EQ(renamed("FusedGemm", "com.microsoft"),
            "'test.onnx': node '/actor/0', operator com.microsoft.FusedGemm: not supported");
}

TEST(OnnxModel, OperatorSetsOutOfRangeAreRefused) {
  const auto message = [](int opset) {
    return refusal([&](onnx::ModelProto& model) { model.mutable_opset_import(0)->set_version(opset); });
  };
  EXPECT_SENTENCE(message(10));
  EXPECT_SENTENCE(message(19));
  EXPECT_EQ(message(18), "(nothing was thrown)");
  EXPECT_EQ(message(11), "(nothing was thrown)");
  EXPECT_SENTENCE(refusal([](onnx::ModelProto& model) { model.clear_opset_import(); }));
}

onnx::TensorProto& weight(onnx::ModelProto& model) { return *model.mutable_graph()->mutable_initializer(0); }

void set_weights(onnx::ModelProto& model, const std::vector<float>& values) {
  weight(model).set_raw_data(values.data(), values.size() * sizeof(float));
}

TEST(OnnxModel, WeightsThatAreNotThereOrNotFiniteAreRefused) {
  const float nan = std::nanf(""), infinity = std::numeric_limits<float>::infinity();
  EXPECT_SENTENCE(refusal([&](auto& model) { set_weights(model, {1.0F, nan}); }));
  EXPECT_SENTENCE(refusal([&](auto& model) { set_weights(model, {infinity, 1.0F}); }));
  EXPECT_SENTENCE(refusal([](auto& model) { weight(model).set_data_location(onnx::TensorProto::EXTERNAL); }));
  EXPECT_SENTENCE(refusal([](auto& model) { set_weights(model, {1.0F}); }));
  EXPECT_SENTENCE(refusal([](auto& model) { weight(model).set_dims(0, std::int64_t{1} << 62); }));
  EXPECT_SENTENCE(refusal([](auto& model) { weight(model).set_dims(0, -2); }));
  EXPECT_SENTENCE(refusal([](auto& model) { weight(model).set_data_type(onnx::TensorProto::UINT8); }));
  EXPECT_SENTENCE(refusal([](auto& model) { weight(model).set_data_type(99); }));
  EXPECT_SENTENCE(refusal([](auto& model) { *model.mutable_graph()->add_initializer() = weight(model); }));
}

TEST(OnnxModel, PortsThatDoNotFitAreRefused) {
  const auto type = [](onnx::ModelProto& model) {
    return model.mutable_graph()->mutable_input(0)->mutable_type()->mutable_tensor_type();
  };
  EXPECT_SENTENCE(refusal([&](auto& model) { type(model)->set_elem_type(onnx::TensorProto::INT64); }));
  EXPECT_SENTENCE(refusal([&](auto& model) { type(model)->mutable_shape()->mutable_dim(1)->set_dim_value(0); }));
  EXPECT_SENTENCE(refusal([&](auto& model) { type(model)->mutable_shape()->mutable_dim(1)->set_dim_value(1L << 40); }));
  EXPECT_SENTENCE(refusal([](auto& model) { model.mutable_graph()->mutable_output(0)->set_name("z"); }));
  EXPECT_SENTENCE(refusal([](auto& model) { model.mutable_graph()->clear_output(); }));
  EXPECT_SENTENCE(refusal([](auto& model) {
    auto* shape = model.mutable_graph()->mutable_output(0)->mutable_type()->mutable_tensor_type();
    shape->mutable_shape()->mutable_dim(1)->set_dim_value(4);
  }));
}

TEST(OnnxModel, NodesThatDoNotFitAreRefused) {
  const auto node = [](onnx::ModelProto& model) { return model.mutable_graph()->mutable_node(0); };
  EXPECT_SENTENCE(refusal([&](auto& model) { node(model)->set_input(0, "later"); }));
  EXPECT_SENTENCE(refusal([&](auto& model) { node(model)->add_input("x"); }));
  EXPECT_SENTENCE(refusal([&](auto& model) { node(model)->set_input(1, ""); }));
  EXPECT_SENTENCE(refusal([&](auto& model) { node(model)->add_output("z"); }));
  EXPECT_SENTENCE(refusal([&](auto& model) { node(model)->set_output(0, "x"); }));
  EXPECT_SENTENCE(refusal([&](auto& model) {
    node(model)->set_op_type("Gemm");
    auto* attribute = node(model)->add_attribute();
    attribute->set_name("alpha");
    attribute->set_type(onnx::AttributeProto::INT);
  }));
  EXPECT_SENTENCE(refusal([&](auto& model) {
    node(model)->set_op_type("If");
    node(model)->add_attribute()->set_type(onnx::AttributeProto::GRAPH);
  }));
}

TEST(OnnxModel, EveryTruncationIsRefusedOrStillWhole) {
  OnnxWriter writer;
  fill_small(writer);
  const std::string bytes = writer.bytes();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const std::string message =
        thrown_message<InputError>([&] { (void)parse_onnx(bytes.substr(0, size), "cut.onnx"); });
    if (message != "(nothing was thrown)") {
      EXPECT_THAT(message, HasSubstr("'cut.onnx': "));
    }
  }
}

}  // namespace
}  // namespace duet::test
