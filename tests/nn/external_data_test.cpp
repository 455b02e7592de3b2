// Numbers of an ONNX file that lie in files beside it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <onnx/onnx_pb.h>

#include <cstring>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/nn/onnx/onnx_model.h"
#include "tests/nn/evaluate.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet::test {
namespace {

using ::testing::ElementsAre;

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
