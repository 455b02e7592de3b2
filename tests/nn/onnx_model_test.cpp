#include "duet/nn/onnx/onnx_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <onnx/onnx_pb.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/nn/catalogue/load_network.h"
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

// Numbers of an ONNX file that lie in files beside it.

using Entries = std::map<std::string, std::string>;

void make_external(onnx::TensorProto& tensor, const Entries& entries) {
  tensor.clear_raw_data();
  tensor.set_data_location(onnx::TensorProto::EXTERNAL);
  for (const auto& [key, value] : entries) {
    auto* entry = tensor.add_external_data();
    entry->set_key(key);
    entry->set_value(value);
  }
}

// y = W x of two numbers; W lies in the files of `folder`, which has "net.data": 8 bytes of others, then 2 and 3.
struct ExternalFile {
  explicit ExternalFile(const Entries& entries = {{"location", "net.data"}, {"offset", "8"}, {"length", "8"}}) {
    OnnxWriter writer;
    writer.input("x", {1, 2}).constant("W", {2, 1}, {0.0F, 0.0F}).node("MatMul", {"x", "W"}, {"y"}).output("y");
    make_external(*writer.model().mutable_graph()->mutable_initializer(0), entries);
    write_file(path, writer.bytes());
    const float numbers[] = {7.0F, 7.0F, 2.0F, 3.0F};
    write_file(folder / "net.data", {reinterpret_cast<const char*>(numbers), sizeof numbers});
  }
  [[nodiscard]] std::string refusal() const {
    return thrown_message<InputError>([&] { load_network(path); });
  }
  ScratchFolder folder;
  std::string path = folder / "net.onnx";
};

TEST(ExternalData, IsReadFromItsPlaceInTheFileBesideTheModel) {
  EXPECT_THAT(evaluate(*load_network(ExternalFile().path), {{10.0F, 1.0F}})[0], ElementsAre(23.0F));
  const ExternalFile to_the_end(Entries{{"location", "net.data"}, {"offset", "8"}, {"checksum", "not looked at"}});
  EXPECT_THAT(evaluate(*load_network(to_the_end.path), {{10.0F, 1.0F}})[0], ElementsAre(23.0F));
  ExternalFile below(Entries{{"location", "weights/net.data"}, {"length", "8"}});
  write_file(below.folder / "weights/net.data", read_file(below.folder / "net.data").substr(8));
  EXPECT_THAT(evaluate(*load_network(below.path), {{10.0F, 1.0F}})[0], ElementsAre(23.0F));
}

TEST(ExternalData, OfAnAttributeIsReadToo) {
  const ExternalFile file;
  OnnxWriter writer;
  const OnnxTensor zeros{.type = ElementType::kFloat, .shape = {2, 1}, .floats = {0.0F, 0.0F}, .integers = {}};
  writer.input("x", {1, 2}).node("Constant", {}, {"W"}, {{"value", zeros}}).node("MatMul", {"x", "W"}, {"y"});
  auto* attribute = writer.output("y").model().mutable_graph()->mutable_node(0)->mutable_attribute(0);
  make_external(*attribute->mutable_t(), {{"location", "net.data"}, {"offset", "8"}});
  write_file(file.path, writer.bytes());
  EXPECT_THAT(evaluate(*load_network(file.path), {{10.0F, 1.0F}})[0], ElementsAre(23.0F));
  EXPECT_EQ(network_files(file.path).size(), 2U);
}

TEST(ExternalData, IsAmongTheFilesOfItsNetwork) {
  const ExternalFile file;
  const LoadedFiles files = network_files(file.path);
  ASSERT_EQ(files.size(), 2U);
  EXPECT_EQ(files[0].role, "network");
  EXPECT_EQ(files[0].path, file.path);
  EXPECT_EQ(files[1].role, "network data net.data");
  EXPECT_EQ(files[1].path, file.folder / "net.data");
  EXPECT_EQ(network_files(ExternalFile(Entries{{"location", "/etc/hostname"}}).path).size(), 1U);
}

TEST(ExternalData, OutsideOfTheModelsFolderIsRefused) {
  for (const char* location : {"", "/etc/hostname", "../net.data", "weights/../../net.data", ".."})
    EXPECT_SENTENCE(ExternalFile(Entries{{"location", location}}).refusal());
  const ExternalFile file(Entries{{"location", "link.data"}, {"offset", "8"}});
  const ScratchFolder elsewhere;
  write_file(elsewhere / "net.data", read_file(file.folder / "net.data"));
  std::filesystem::create_symlink(elsewhere / "net.data", file.folder / "link.data");
  EXPECT_SENTENCE(file.refusal());
  std::filesystem::remove(file.folder / "link.data");
  std::filesystem::create_symlink(file.folder / "net.data", file.folder / "link.data");  // a link within is none
  EXPECT_THAT(evaluate(*load_network(file.path), {{10.0F, 1.0F}})[0], ElementsAre(23.0F));
}

TEST(ExternalData, ThatIsNotThereOrTooShortIsRefused) {
  EXPECT_SENTENCE(ExternalFile(Entries{{"location", "none.data"}}).refusal());
  const ExternalFile folder(Entries{{"location", "weights"}});
  std::filesystem::create_directory(folder.folder / "weights");
  EXPECT_SENTENCE(folder.refusal());
  EXPECT_SENTENCE(ExternalFile(Entries{{"location", "net.data"}, {"offset", "12"}, {"length", "8"}}).refusal());
  EXPECT_SENTENCE(ExternalFile(Entries{{"location", "net.data"}, {"offset", "17"}}).refusal());
  EXPECT_SENTENCE(
      ExternalFile(Entries{{"location", "net.data"}, {"offset", "8"}, {"length", "9223372036854775807"}}).refusal());
  EXPECT_SENTENCE(ExternalFile(Entries{{"location", "net.data"}, {"offset", "12"}}).refusal());
}

TEST(ExternalData, WithAPlaceThatIsNoNumberOrAnUnknownKeyIsRefused) {
  for (const char* offset : {"-1", "8x", "", "1e3", "99999999999999999999"})
    EXPECT_SENTENCE(ExternalFile(Entries{{"location", "net.data"}, {"offset", offset}}).refusal());
  EXPECT_SENTENCE(ExternalFile(Entries{{"location", "net.data"}, {"basepath", "/"}}).refusal());
}

// A tensor of more than the limit is refused before a byte of it is read: the file is one hole.
TEST(ExternalData, OfMoreThanTheLimitIsRefused) {
  const ExternalFile file(Entries{{"location", "net.data"}});
  std::filesystem::resize_file(file.folder / "net.data", static_cast<std::uintmax_t>(kMostExternalBytes) + 1);
  EXPECT_SENTENCE(file.refusal());
}

}  // namespace
}  // namespace duet::test
