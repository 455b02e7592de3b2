// Every random quantity of a clip, each from its own Philox stream (seed; task, index, quantity): fixing one of them by
// an option leaves all others as they were. Drawn and given values are recorded as text for the clip's `source`.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "duet/core/random.h"
#include "duet/core/task.h"

namespace duet::synthesis {

// Names of one person's quantities begin with this.
inline constexpr std::array<std::string_view, 2> kWho = {"a.", "b."};

// 10, 50 and 90 % of a quantity over clips.
struct Deciles {
  double low = 0.0, middle = 0.0, high = 0.0;
};

class Draws {
 public:
  Draws(std::uint64_t seed, Task task, int index);

  // Uniform in [low, high), or `given` where it is set.
  double uniform(const std::string& quantity, double low, double high, std::optional<double> given = {});
  // A quantity that follows the style (0 ... 1): low + (high - low) * style, give or take a fifth of the range, kept
  // inside it.
  double styled(const std::string& quantity, double style, double low, double high);
  // Through the 10, 50 and 90 % of a distribution, straight in between and a quarter of the last stretch beyond.
  double spread(const std::string& quantity, const Deciles& deciles);
  bool chance(const std::string& quantity, double probability, std::optional<bool> given = {});
  [[nodiscard]] Random stream(std::string_view quantity) const;

  void record(const std::string& quantity, double value);
  void record(const std::string& quantity, const std::string& value) { recorded_[quantity] = value; }
  [[nodiscard]] const std::map<std::string, std::string>& recorded() const { return recorded_; }

 private:
  std::uint64_t seed_;
  std::string task_;
  std::string index_;
  std::map<std::string, std::string> recorded_;
};

}  // namespace duet::synthesis
