#include "duet/report/tables/cells.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace duet {
namespace {

// `text` formats each of the three numbers.
template <typename Text>
std::string with_interval(double value, const Interval& interval, const Text& text) {
  if (!std::isfinite(value) || !std::isfinite(interval.low)) return text(value);
  return fmt::format("{} [{}, {}]", text(value), text(interval.low), text(interval.high));
}

}  // namespace

std::string task_title(const std::string& task) {
  if (task == "all") return "Overall";
  std::string title = task;
  std::replace(title.begin(), title.end(), '_', '-');
  if (!title.empty() && title.front() >= 'a' && title.front() <= 'z') title.front() -= 'a' - 'A';
  return title;
}

std::string count_cell(long count) { return fmt::format("{}", count); }

std::string counted(long count, const char* noun) { return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s"); }

// Adding 0.0 turns -0.0 into 0.0, so that no table prints "-0.0".
std::string decimals(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value + 0.0, digits) : "-";
}

std::string decimals(double value, const Interval& interval, int digits) {
  return with_interval(value, interval, [&](double number) { return decimals(number, digits); });
}

std::string percent(double fraction) { return decimals(100.0 * fraction, 1); }

std::string percent(double fraction, const Interval& interval) {
  return with_interval(fraction, interval, [](double number) { return percent(number); });
}

std::string points(double difference, const Interval& interval) {
  if (!std::isfinite(difference)) return "-";
  const auto rounded = [](double fraction) { return std::round(1000.0 * fraction) / 10.0 + 0.0; };
  if (!std::isfinite(interval.low)) return fmt::format("{:+.1f}", rounded(difference));
  return fmt::format("{:+.1f} [{:.1f}, {:.1f}]", rounded(difference), rounded(interval.low), rounded(interval.high));
}

std::string p_cell(double p) {
  if (std::isnan(p)) return "-";
  return p < 0.001 ? "<0.001" : fmt::format("{:.3f}", p);
}

std::string p_text(double p) { return p < 0.001 ? "p < 0.001" : "p = " + p_cell(p); }

std::string significant(double value) { return std::isfinite(value) ? fmt::format("{:.4g}", value) : "-"; }

std::string short_number(double value, int most_decimals) {
  if (!std::isfinite(value)) return "-";
  const double size = std::abs(value);
  if (size >= 1e5) return fmt::format("{:.3g}", value);
  return fmt::format("{:.{}f}", value,
                     std::min(most_decimals, size >= 100.0  ? 0
                                             : size >= 10.0 ? 1
                                             : size >= 1.0  ? 2
                                                            : 3));
}

std::string short_number(double value, const Interval& interval, int most_decimals) {
  return with_interval(value, interval, [&](double number) { return short_number(number, most_decimals); });
}

}  // namespace duet
