#include "duet/tasks/synthesis/draws.h"

#include <fmt/format.h>

#include <algorithm>

namespace duet::synthesis {

Draws::Draws(std::uint64_t seed, Task task, int index)
    : seed_(seed), task_(to_string(task)), index_(std::to_string(index)) {}

Random Draws::stream(std::string_view quantity) const {
  return {seed_, stream_key({"synthesis", task_, index_, quantity})};
}

void Draws::record(const std::string& quantity, double value) { recorded_[quantity] = fmt::format("{}", value); }

double Draws::uniform(const std::string& quantity, double low, double high, std::optional<double> given) {
  const double value = given ? *given : stream(quantity).uniform(low, high);
  record(quantity, value);
  return value;
}

double Draws::styled(const std::string& quantity, double style, double low, double high) {
  const double share = std::clamp(style + stream(quantity).uniform(-0.2, 0.2), 0.0, 1.0);
  const double value = low + (high - low) * share;
  record(quantity, value);
  return value;
}

double Draws::spread(const std::string& quantity, const Deciles& deciles) {
  const double u = stream(quantity).uniform();
  const double value = u < 0.5 ? deciles.middle + (u - 0.5) / 0.4 * (deciles.middle - deciles.low)
                               : deciles.middle + (u - 0.5) / 0.4 * (deciles.high - deciles.middle);
  record(quantity, value);
  return value;
}

bool Draws::chance(const std::string& quantity, double probability, std::optional<bool> given) {
  const bool value = given ? *given : stream(quantity).chance(probability);
  recorded_[quantity] = value ? "yes" : "no";
  return value;
}

}  // namespace duet::synthesis
