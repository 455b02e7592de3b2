#include "duet/metrics/contact_limits.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/robots/yaml_schema.h"

namespace duet {
namespace {

constexpr const char* kSchema = "duet.contact_limits/1";

void read_transient(const YamlSection& section, RegionLimits& limits) {
  constexpr const char* kKey = "transient_n";
  if (!section.has(kKey)) return;
  const YAML::Node node = section.node(kKey);
  if (node.IsScalar() && node.Scalar() == "not_allowed") {
    if (!limits.quasi_static_n) section.fail_key(kKey, "'not_allowed' needs 'quasi_static_n', found none");
    limits.transient_allowed = false;
    return;
  }
  double value = 0.0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value) || value <= 0.0)
    section.refuse_key(kKey, "a number > 0 or 'not_allowed'", node);
  if (limits.quasi_static_n && value < *limits.quasi_static_n)
    section.fail_key(kKey,
                     fmt::format("expected at least 'quasi_static_n' = {}, found {}", *limits.quasi_static_n, value));
  limits.transient_n = value;
}

const Schema<RegionLimits>& region_schema() {
  using L = RegionLimits;
  static const Schema<L> schema = {required_key({"region"}, &L::region),
                                   optional_key({.name = "quasi_static_n", .range = kPositive}, &L::quasi_static_n),
                                   {"transient_n", read_transient},
                                   optional_key({.name = "pressure_n_cm2", .range = kPositive}, &L::pressure_n_cm2),
                                   optional_key({.name = "stiffness_n_mm", .range = kPositive}, &L::stiffness_n_mm),
                                   optional_key({.name = "mass_kg", .range = kPositive}, &L::mass_kg)};
  return schema;
}

// The key must be there; nothing or blanks behind it mean that nobody has checked the table.
std::string read_verified_by(const YamlSection& top) {
  const YAML::Node node = top.node("verified_by");
  if (node.IsNull()) return "";
  if (!node.IsScalar()) top.refuse_key("verified_by", "a name or nothing", node);
  const std::string& name = node.Scalar();
  return name.find_first_not_of(" \t\n") == std::string::npos ? "" : name;
}

std::vector<std::string> region_names(const ContactLimits& limits) {
  std::vector<std::string> names;
  for (const RegionLimits& entry : limits.regions) names.push_back(entry.region);
  return names;
}

}  // namespace

std::string ContactLimits::mark() const {
  return verified() ? "limits verified by " + verified_by : "unverified limits";
}

const RegionLimits& ContactLimits::region(std::string_view wanted) const {
  for (const RegionLimits& entry : regions)
    if (entry.region == wanted) return entry;
  throw std::invalid_argument(fmt::format("contact limits '{}': expected an entry for the region '{}', found {}", name,
                                          wanted, fmt::join(region_names(*this), ", ")));
}

ContactLimits parse_contact_limits(const std::string& text, const std::string& file) {
  const YamlSection top(file, parse_yaml(text, file), "contact limits",
                        {"schema", "name", "source", "verified_by", "regions"});
  top.require_schema(kSchema);
  ContactLimits limits{
      .name = top.text("name"), .source = top.text("source"), .verified_by = read_verified_by(top), .regions = {}};
  (void)top.node("regions");
  for (const YAML::Node& node : top.items("regions")) {
    RegionLimits entry;
    read_mapping(file, node, "contact limits of a region", region_schema(), entry);
    for (const RegionLimits& earlier : limits.regions)
      if (earlier.region == entry.region)
        top.fail(node.Mark().line + 1, fmt::format("expected each region once, found '{}' again", entry.region));
    limits.regions.push_back(std::move(entry));
  }
  return limits;
}

ContactLimits load_contact_limits(const std::string& path) { return parse_contact_limits(read_text(path), path); }

std::string default_contact_limits_path() {
  return share_file("table of contact limits", "metrics/limits/iso_ts_15066.yaml");
}

}  // namespace duet
