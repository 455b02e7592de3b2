// An estimate in the long form (tidy data) that CSV and JSON have: what it is of, what it is called, its value, what it
// is over and its interval. An analysis is a list of them; its tables are pivots of that list (pivot.h). The columns
// are the same for every analysis, so that their files may be joined. Nothing is rounded.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/statistics/statistics.h"

namespace duet {

// A share of episodes with its Wilson interval.
struct Rate {
  long n = 0, k = 0;
  double rate = std::numeric_limits<double>::quiet_NaN();  // NaN where n is 0
  Interval interval = kNoInterval;
};
Rate make_rate(long k, long n, double level);

struct Estimate {
  // The keys; "" where one does not apply. An estimate of two names both: "bullet vs mujoco". "all": of all
  // tasks, or of all physics engines, together.
  std::string source = "duet";  // or "paper": as the supplement prints it
  std::string engine = {}, controller = {}, policy = {}, arm = {}, perturbation = {}, task = {};
  std::string of = {};  // what else tells it apart: a metric, a force, a region, a level, a variant, a command
  std::string name = {}, unit = "1";
  std::optional<long> n = {}, k = {};  // how many it is over; of them those that count, where it is a share
  double value = std::numeric_limits<double>::quiet_NaN();  // NaN: not defined
  Interval interval = kNoInterval;
  std::string text = {};  // in the place of a value where it is a word
};

using Estimates = std::vector<Estimate>;

// Estimates with the same keys, one after another.
struct EstimatesOf {
  Estimate keys;
  Estimates& into;

  void add(std::string_view name, std::optional<long> n, double value, const Interval& interval = kNoInterval,
           std::string_view unit = "1") const;
  void rate(std::string_view name, const Rate& rate) const;
  void count(std::string_view name, std::optional<long> n, long count) const;
  void word(std::string_view name, const std::string& text) const;
};

// A line per estimate; `analysis` and the level of intervals are columns, too. Empty where an estimate has no such
// value.
std::string estimates_csv(std::string_view analysis, double level, const Estimates& estimates);

// A list of objects with the names of those columns, but `analysis` and `level`; what is empty is left out, a value
// that is not defined is null.
nlohmann::json estimates_json(const Estimates& estimates);

}  // namespace duet
