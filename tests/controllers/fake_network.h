// A network of given ports that remembers what it was shown and answers what a test wants.
#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "duet/controllers/catalogue/registry.h"
#include "duet/nn/network.h"

namespace duet::test {

struct FakeMemory {
  std::vector<std::vector<float>> shown;     // by input, at the last run
  std::vector<std::vector<float>> answered;  // by output
  int runs = 0, resets = 0;
};

class FakeNetwork final : public Network {
 public:
  FakeNetwork(std::vector<Port> inputs, std::vector<Port> outputs, FakeMemory& memory)
      : inputs_(std::move(inputs)), outputs_(std::move(outputs)), memory_(memory) {
    for (const Port& port : inputs_) memory_.shown.emplace_back(port.size);
    for (const Port& port : outputs_) memory_.answered.emplace_back(port.size);
  }
  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }
  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    for (size_t i = 0; i < inputs.size(); ++i) std::ranges::copy(inputs[i], memory_.shown[i].begin());
    for (size_t i = 0; i < outputs.size(); ++i) std::ranges::copy(memory_.answered[i], outputs[i].begin());
    ++memory_.runs;
  }
  void reset() override { ++memory_.resets; }

 private:
  std::vector<Port> inputs_, outputs_;
  FakeMemory& memory_;
};

// The robot of a card, by name or path.
inline std::shared_ptr<const RobotModel> body(const std::string& card) { return load_shared_robot(card_path(card)); }

}  // namespace duet::test
