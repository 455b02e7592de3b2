// What the process of a policy sends: a stream cut into messages, each parsed and decoded as a plan.
#include <numeric>

#include "policies/external/message.h"
#include "policies/external/plan_decoder.h"
#include "tests/fuzz/reader.h"

namespace {

std::shared_ptr<const duet::RobotModel> robot() {
  static const auto robot = duet::load_shared_robot();
  return robot;
}

const std::string& sample() {
  static const std::string text = [] {
    std::string anchors;
    for (int i = 0; i < duet::kAnchors; ++i) {
      anchors += i == 0 ? "[0,0,0.75,1,0,0,0" : ",[0,0,0.75,1,0,0,0";
      for (int j = 0; j < robot()->dof(); ++j) anchors += ",0.1";
      anchors += "]";
    }
    return duet::framed(R"({"type":"hello","version":1,"joints":["a"]})") + duet::framed(R"({"type":"ready"})") +
           duet::framed(R"({"type":"plan","tick":10,"anchors":[)" + anchors + "]}");
  }();
  return text;
}

const duet::PlanDecoder& decoder() {
  static const duet::PlanDecoder decoder = [] {
    std::vector<int> joints(static_cast<std::size_t>(robot()->dof()));
    std::iota(joints.begin(), joints.end(), 0);
    return duet::PlanDecoder({}, robot(), joints);
  }();
  return decoder;
}

// A message that is refused does not end the connection, a length that is refused does.
void read_one(const std::string& text) {
  duet::fuzz::read_or_refuse(
      [&] { (void)decoder().decode(duet::parse_policy_message(text).numbers, robot()->standing_state()); });
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  return duet::fuzz::mutate(data, size, max_size, seed, sample());
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kPiece = 37;
  return duet::fuzz::read_or_refuse([&] {
    const std::string_view bytes = duet::fuzz::text_of(data, size);
    duet::MessageBuffer buffer;
    for (std::size_t at = 0; at < size; at += kPiece) {
      buffer.append(bytes.substr(at, kPiece));
      while (const auto message = buffer.next()) read_one(*message);
    }
  });
}
