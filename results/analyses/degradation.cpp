#include "duet/results/analyses/degradation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <tuple>

#include "duet/results/analyses/policy_table.h"

namespace duet {
namespace {

struct Unit {
  std::string_view name, si;
  double factor;
};
constexpr std::array<Unit, 6> kUnits = {{{"mm", "m", 1e-3},
                                         {"cm", "m", 1e-2},
                                         {"ms", "s", 1e-3},
                                         {"deg", "rad", 0.017453292519943295},
                                         {"n", "N", 1.0},
                                         {"kg", "kg", 1.0}}};

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

// Length of what precedes the last run of characters for which `holds`.
template <typename Holds>
std::size_t strip(std::string_view text, const Holds& holds) {
  std::size_t end = text.size();
  while (end > 0 && holds(text[end - 1])) --end;
  return end;
}

PerturbationSize in_si(std::string_view family, double value, std::string_view unit) {
  for (const Unit& known : kUnits)
    if (known.name == unit) return {std::string(family), value * known.factor, std::string(known.si)};
  return {std::string(family), value, std::string(unit)};
}

// Place of a perturbation among others: clean, then by family and size, those without a size last by name.
auto place(const std::string& name) {
  const std::optional<PerturbationSize> size = perturbation_size(name);
  return std::make_tuple(name != kClean, !size.has_value(), size ? size->family : "", size ? size->x : 0.0, name);
}

std::vector<std::string> perturbations_of(const PerturbedRows& rows) {
  std::vector<std::string> names;
  names.reserve(rows.size());
  for (const auto& [name, episodes] : rows) names.push_back(name);
  std::sort(names.begin(), names.end(), [](const std::string& a, const std::string& b) { return place(a) < place(b); });
  return names;
}

void finish(DegradationCurve& curve) {
  std::sort(curve.points.begin(), curve.points.end(),
            [](const CurvePoint& a, const CurvePoint& b) { return a.x < b.x; });
  double area = 0.0;
  double clean = 0.0;
  for (std::size_t i = 0; i < curve.points.size(); ++i) {
    const CurvePoint& point = curve.points[i];
    if (point.x == 0.0) clean = point.success;
    if (i == 0) continue;
    const CurvePoint& before = curve.points[i - 1];
    area += 0.5 * (point.success + before.success) * (point.x - before.x);
  }
  const double span = curve.points.back().x - curve.points.front().x;
  curve.normalised_area = clean > 0.0 ? area / (span * clean) : std::numeric_limits<double>::quiet_NaN();
}

// Families of the perturbations of one policy, each with its clean point.
std::vector<DegradationCurve> curves_of(const PolicyKey& key, const std::vector<PerturbedSuccess>& success) {
  std::map<std::pair<std::string, std::string>, DegradationCurve> curves;
  for (const PerturbedSuccess& entry : success) {
    const std::optional<PerturbationSize> size = perturbation_size(entry.perturbation);
    if (!size || size->x == 0.0 || entry.success.n == 0) continue;
    DegradationCurve& curve = curves[{size->family, size->unit}];
    if (curve.points.empty()) curve.points.push_back({0.0, success.front().success.rate});
    curve.points.push_back({size->x, entry.success.rate});
    if (std::abs(size->x) < std::abs(curve.largest)) continue;
    curve.largest = size->x;
    curve.difference = entry.difference;
  }
  std::vector<DegradationCurve> list;
  for (auto& [name, curve] : curves) {
    curve.key = key;
    std::tie(curve.family, curve.unit) = name;
    finish(curve);
    list.push_back(std::move(curve));
  }
  return list;
}

std::vector<PerturbedSuccess> success_of(const PolicyKey& key, const PerturbedRows& rows, double level) {
  const EpisodeRows& clean = rows.find(kClean)->second;
  std::vector<PerturbedSuccess> success;
  for (const std::string& perturbation : perturbations_of(rows)) {
    const EpisodeRows& episodes = rows.find(perturbation)->second;
    success.push_back({.key = key,
                       .perturbation = perturbation,
                       .success = headline_rate(episodes, level),
                       .paper = verdict_rate(episodes, "paper", "paper", level),
                       .difference = {}});
    if (perturbation != kClean) success.back().difference = paired_difference(episodes, clean, level);
  }
  return success;
}

// Table S9's curve of a family; without points where it has none.
DegradationCurve paper_curve(const std::string& family, const std::string& unit) {
  DegradationCurve curve;
  curve.key.policy = "D-STAR";
  curve.family = family;
  curve.unit = unit;
  const double clean = paper_policies().front().overall / 100.0;
  for (const PaperPolicy& paper : paper_policies()) {
    if (paper.family != family) continue;
    if (curve.points.empty()) curve.points.push_back({0.0, clean});
    curve.points.push_back({paper.size, paper.overall / 100.0});
    curve.largest = paper.size;
    curve.difference.difference = paper.overall / 100.0 - clean;
  }
  if (!curve.points.empty()) finish(curve);
  return curve;
}

std::vector<DegradationCurve> paper_curves(const std::vector<DegradationCurve>& ours) {
  std::set<std::pair<std::string, std::string>> families;
  for (const DegradationCurve& curve : ours) families.emplace(curve.family, curve.unit);
  std::vector<DegradationCurve> curves;
  for (const auto& [family, unit] : families) {
    if (unit != (family == "jitter" ? "m" : "")) continue;
    if (DegradationCurve curve = paper_curve(family, unit); !curve.points.empty()) curves.push_back(std::move(curve));
  }
  return curves;
}

}  // namespace

std::optional<PerturbationSize> perturbation_size(std::string_view name) {
  const std::size_t number_end = strip(name, is_letter);
  std::size_t begin = strip(name.substr(0, number_end), [](char c) { return is_digit(c) || c == '.'; });
  const std::size_t digits = begin;
  const bool is_signed = begin > 1 && (name[begin - 1] == '-' || name[begin - 1] == '+') && name[begin - 2] == '_';
  if (is_signed) --begin;
  const std::string number(name.substr(begin, number_end - begin));
  std::size_t family_end = begin;
  if (family_end > 0 && name[family_end - 1] == '_') --family_end;
  if (digits == number_end ||
      !std::any_of(name.begin(), name.begin() + static_cast<std::ptrdiff_t>(family_end), is_letter) ||
      !is_digit(name[digits]) || number.back() == '.' || std::count(number.begin(), number.end(), '.') > 1)
    return std::nullopt;
  const std::size_t sign = is_signed && number.front() == '+' ? 1 : 0;
  return in_si(name.substr(0, family_end), std::stod(number.substr(sign)), name.substr(number_end));
}

Degradation degradation(const std::vector<EpisodeRow>& rows, const PolicyTableOptions& options) {
  Degradation result{.level = options.level, .success = {}, .curves = {}, .paper = {}};
  for (const auto& [key, perturbed] : rows_of_policies(rows)) {
    if (perturbed.size() < 2 || !perturbed.contains(kClean)) continue;
    std::vector<PerturbedSuccess> success = success_of(key, perturbed, options.level);
    for (DegradationCurve& curve : curves_of(key, success)) result.curves.push_back(std::move(curve));
    result.success.insert(result.success.end(), success.begin(), success.end());
  }
  result.paper = paper_curves(result.curves);
  return result;
}

}  // namespace duet
