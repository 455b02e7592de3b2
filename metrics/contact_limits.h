// Limits of a contact with a person, per body region: an editable table in the form of ISO/TS 15066 (YAML,
// docs/file-formats.md). A table that nobody has checked against the standard is "unverified", and whatever is judged
// by it says so.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

// A limit that is not stated is absent: nothing is held against it.
struct RegionLimits {
  std::string region;  // as in HumanCapsule::region
  std::optional<double> quasi_static_n = {};
  std::optional<double> transient_n = {};
  bool transient_allowed = true;  // false: "not_allowed"; quasi_static_n is then stated and transient_n absent
  std::optional<double> pressure_n_cm2 = {};
  std::optional<double> stiffness_n_mm = {};  // effective spring constant of the region
  std::optional<double> mass_kg = {};         // effective mass of the region
};

struct ContactLimits {
  std::string name;
  std::string source;
  std::string verified_by;  // who checked it against the standard; empty: nobody
  std::vector<RegionLimits> regions;

  [[nodiscard]] bool verified() const { return !verified_by.empty(); }
  // "unverified limits" or "limits verified by NAME".
  [[nodiscard]] std::string mark() const;
  // Throws std::invalid_argument naming the table, the region and those it has.
  [[nodiscard]] const RegionLimits& region(std::string_view name) const;
};

// Throw InputError with file, line, expected and found: no YAML, another schema, unknown, missing or repeated keys, a
// region given twice, a number that is not positive, a transient limit below the quasi-static one or refused without a
// quasi-static one.
ContactLimits parse_contact_limits(const std::string& text, const std::string& file);
ContactLimits load_contact_limits(const std::string& path);

// The table that ships with duet, metrics/limits/iso_ts_15066.yaml: in $DUET_SHARE, in ../share/duet beside
// the program, or in the source tree. Throws MissingError naming the places looked at.
std::string default_contact_limits_path();

}  // namespace duet
