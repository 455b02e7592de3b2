// Files that policies are made from and messages that they send: messages of a process, descriptors, D-STAR's
// configuration and networks, libraries of retrieval, tables of language.
#include <numeric>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/policies/dstar/features.h"
#include "duet/policies/dstar/network.h"
#include "duet/policies/dstar/retrieval.h"
#include "duet/policies/external/channel_values.h"
#include "duet/policies/external/descriptor.h"
#include "duet/policies/external/message.h"
#include "duet/policies/language.h"
#include "tests/fuzz/reader.h"
#include "tests/fuzz/tensor_edit.h"
#include "tests/policies/dstar_fixtures.h"

namespace duet::fuzz {
namespace {

std::shared_ptr<const RobotModel> robot() {
  static const auto robot = load_shared_robot();
  return robot;
}

std::string message_sample(unsigned /*seed*/) {
  std::string anchors;
  for (int i = 0; i < kAnchors; ++i) {
    anchors += i == 0 ? "[0,0,0.75,1,0,0,0" : ",[0,0,0.75,1,0,0,0";
    for (int j = 0; j < robot()->dof(); ++j) anchors += ",0.1";
    anchors += "]";
  }
  return framed(R"({"type":"hello","version":1,"joints":["a"]})") + framed(R"({"type":"ready"})") +
         framed(R"({"type":"plan","tick":10,"anchors":[)" + anchors + "]}");
}

// A message that is refused does not end the connection, a length that is refused does.
void read_one(const PlanDecoder& decoder, const std::string& text) {
  try {
    (void)decoder.decode(parse_policy_message(text).numbers, robot()->standing_state());
  } catch (const InputError&) {
    return;
  }
}

// A stream cut into messages, each parsed and decoded as a plan.
void read_messages(std::string_view bytes) {
  constexpr std::size_t kPiece = 37;
  constexpr int kMostMessages = 2000;  // half a million empty ones, two exceptions each, are only slow
  std::vector<int> joints(static_cast<std::size_t>(robot()->dof()));
  std::iota(joints.begin(), joints.end(), 0);
  static const PlanDecoder decoder({}, robot(), joints);
  MessageBuffer buffer;
  int messages = 0;
  for (std::size_t at = 0; at < bytes.size(); at += kPiece) {
    buffer.append(bytes.substr(at, kPiece));
    while (const auto message = buffer.next()) {
      if (++messages > kMostMessages) return;
      read_one(decoder, *message);
    }
  }
}

std::string descriptor_sample(unsigned seed) {
  const char* name = seed / 64 % 2 == 0 ? "onnx_policy.yaml" : "wave_policy.yaml";
  return read_file(std::string(DUET_SOURCE_DIR "/examples/policies/") + name);
}

void read_descriptor(std::string_view bytes) { (void)parse_policy_descriptor(std::string(bytes), "fuzz.yaml"); }

std::string config_sample(unsigned seed) {
  return to_json_text(seed / 64 % 2 == 0 ? DstarConfig{} : test::small_config());
}

void read_config(std::string_view bytes) { (void)parse_dstar_config(std::string(bytes), "fuzz.json"); }

const SafeTensors& good_network() {
  static const SafeTensors content = [] {
    const std::string path = scratch_folder() + "/dstar.safetensors";
    save_dstar_network(path, random_dstar_network(test::small_config(), *robot(), 1), TensorType::kF16);
    return read_safetensors(path);
  }();
  return content;
}

std::string network_sample(unsigned seed) { return tensors_sample(good_network(), seed); }

void read_network(std::string_view bytes) {
  (void)load_dstar_network(scratch_file("fuzz.safetensors", tensors_of(good_network(), bytes)), *robot());
}

const SafeTensors& good_library() {
  static const SafeTensors content = [] {
    RetrievalLibrary library;
    library.robot = robot()->name;
    library.joints = robot()->joint_names();
    library.tasks = {0, 3};
    library.mean.setZero(kRetrievalKey);
    library.deviation.setOnes(kRetrievalKey);
    library.keys.setZero(kRetrievalKey, 2);
    library.plans.setZero(kPlanSize, 2);
    const std::string path = scratch_folder() + "/library.safetensors";
    save_retrieval_library(path, library);
    return read_safetensors(path);
  }();
  return content;
}

std::string library_sample(unsigned seed) { return tensors_sample(good_library(), seed); }

void read_library(std::string_view bytes) {
  (void)load_retrieval_library(scratch_file("fuzz.safetensors", tensors_of(good_library(), bytes)), *robot());
}

Npz good_table() {
  Npz npz;
  npz.set_text("name", "fuzz");
  npz.set("prompts", std::vector<std::string>{"wave", "shake hands"});
  npz.set("embeddings", std::vector<double>{0.6, 0.8, 0.0, 1.0, 0.0, 0.0}, {2, 3});
  return npz;
}

std::string table_sample(unsigned seed) { return seed % 2 == 0 ? good_table().bytes() : std::string(kEdit); }

void read_table(std::string_view bytes) {
  const auto table = load_language_table(scratch_file("fuzz.npz", archive_of(good_table(), bytes)));
  try {
    (void)table->embed("wave");
  } catch (const std::invalid_argument&) {
    return;  // another prompt than the table's
  }
}

}  // namespace

std::vector<Reader> policy_readers() {
  return {
      {"policy_message", message_sample, read_messages},   {"policy_descriptor", descriptor_sample, read_descriptor},
      {"dstar_config", config_sample, read_config},        {"dstar_network", network_sample, read_network},
      {"retrieval_library", library_sample, read_library}, {"language_table", table_sample, read_table}};
}

}  // namespace duet::fuzz
