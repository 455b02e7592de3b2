// Every random quantity of a clip, each from its own Philox stream (seed; task, index, quantity): fixing one of them by
// an option leaves all others as they were. What was drawn or given is recorded as text for the clip's `source`.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "core/random.h"
#include "core/task.h"

namespace duet::synthesis {

class Draws {
 public:
  Draws(std::uint64_t seed, Task task, int index);

  // Uniform in [low, high), or `given` where it is set.
  double uniform(const std::string& quantity, double low, double high, std::optional<double> given = {});
  // low + (high - low) * style where `given` is empty would be no draw at all: this is one, spread 0.2 of the range
  // about that point and kept inside it. For quantities that follow the style.
  double styled(const std::string& quantity, double style, double low, double high);
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
