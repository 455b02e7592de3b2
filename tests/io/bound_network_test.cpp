#include "duet/io/bound_network.h"

#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "tests/backends/allocation_count.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using testing::ElementsAre;

// y = x + 1, h' = h + x[0]; its own memory counts the runs since the last reset.
class CountingNetwork final : public Network {
 public:
  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }
  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    for (std::size_t i = 0; i < 2; ++i) outputs[0][i] = inputs[0][i] + 1.0F;
    outputs[1][0] = inputs[1][0] + inputs[0][0];
    outputs[2][0] = static_cast<float>(++runs_);
  }
  void reset() override { runs_ = 0; }

 private:
  std::vector<Port> inputs_ = {{"x", 2}, {"h", 1}}, outputs_ = {{"y", 2}, {"next_h", 1}, {"runs", 1}};
  int runs_ = 0;
};

BoundNetwork counting() { return {std::make_unique<CountingNetwork>(), "mine.yaml", "net.onnx"}; }

TEST(BoundNetwork, RunsOnWhatItsInputsHoldAndFeedsItsStatesBack) {
  BoundNetwork network = counting();
  std::vector<float> x = {2.0F, 3.0F};
  network.bind_input("x", 4, x, {});
  network.bind_state("h", 5, "next_h");
  network.require_all_bound();
  const int y = network.find_output("y", 6), runs = network.find_output("runs", 6);
  for (int episode = 0; episode < 2; ++episode) {
    x[0] = 2.0F;
    network.run();
    EXPECT_THAT(network.output(y), ElementsAre(3.0F, 4.0F));
    EXPECT_THAT(network.output(1), ElementsAre(2.0F));
    x[0] = 5.0F;
    network.run();
    EXPECT_THAT(network.output(1), ElementsAre(7.0F));
    EXPECT_THAT(network.output(runs), ElementsAre(2.0F));
    network.reset();
  }
}

TEST(BoundNetwork, AllocatesNothingInRun) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: the sanitizer counts";
  BoundNetwork network = counting();
  const std::vector<float> x = {2.0F, 3.0F};
  network.bind_input("x", 4, x, {});
  network.bind_state("h", 5, "next_h");
  const long before = test::allocation_count();
  network.run();
  network.reset();
  EXPECT_EQ(test::allocation_count(), before);
}

TEST(BoundNetwork, RefusesInputsThatAreNotItsOwnWithTheLayout) {
  BoundNetwork network = counting();
  const std::vector<float> x = {2.0F, 3.0F, 4.0F};
  const auto bind = [&](const std::string& name, std::size_t size) {
    return thrown_message<InputError>([&] {
      network.bind_input(name, 4, std::span(x).first(size), {{{{"gyro", 3}}, 1}});
    });
  };
  EXPECT_SENTENCE(bind("x", 3));
  EXPECT_SENTENCE(bind("z", 2));
  EXPECT_SENTENCE(bind("", 2));
  EXPECT_EQ(bind("x", 2), "(nothing was thrown)");
  EXPECT_SENTENCE(bind("x", 2));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { network.require_all_bound(); }));
}

TEST(BoundNetwork, RefusesStatesThatDoNotFit) {
  BoundNetwork network = counting();
  EXPECT_SENTENCE(thrown_message<InputError>([&] { network.bind_state("h", 5, "y"); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { network.bind_state("h", 5, "next"); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)network.find_output("", 7); }));
}

}  // namespace
}  // namespace duet
