#include "duet/people/formats/gvhmr.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/archives/zip/zip.h"
#include "duet/core/data_file.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/people/body_people.h"
#include "duet/people/clip_files.h"

namespace duet {
namespace {

constexpr double kGvhmrRate = 30.0;
constexpr std::string_view kGvhmrKey = "smpl_params_global";

bool is_torch_name(const std::string& name) { return name.ends_with(".pt"); }

bool is_torch_file(const std::string& path) {
  const std::vector<std::string> entries = zip_entry_names(path);
  const auto ends = [&](std::string_view end) {
    return std::any_of(entries.begin(), entries.end(), [&](const std::string& entry) { return entry.ends_with(end); });
  };
  return ends("/data.pkl") && !ends("/constants.pkl");  // those are of TorchScript
}

bool recognises_gvhmr(std::span<const std::string> paths) { return both_are(paths, is_torch_name, is_torch_file); }

std::vector<ClipPlace> find_gvhmr(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  return pairs_at(paths, is_torch_name, "GVHMR");
}

BodyMotion read_gvhmr_person(const std::string& path) {
  const TorchFile file = parse_torch(read_data(path), path);
  const Pickle& pickle = file.pickle;
  const PickleNode* parameters = pickle.find(pickle[pickle.root], kGvhmrKey);
  if (parameters == nullptr || parameters->kind != PickleKind::kDict)
    throw InputError(fmt::format("'{}': expected a dict with the key '{}' (GVHMR's hmr4d_results.pt), found {}",
                                 shown(path), kGvhmrKey, parameters == nullptr ? "none" : to_string(parameters->kind)));
  const auto table = [&](const std::string& key) {
    const PickleNode* node = pickle.find(*parameters, key);
    if (node == nullptr) throw InputError(fmt::format("'{}': no '{}' in '{}'", shown(path), key, kGvhmrKey));
    return table_of(file, *node, fmt::format("'{}' of '{}'", key, kGvhmrKey));
  };
  BodyMotion motion = body_motion(path, table("global_orient"), table("body_pose"), table("transl"));
  if (pickle.find(*parameters, "betas") != nullptr) motion.betas = mean_betas(table("betas"));
  return motion;
}

RawPeople read_gvhmr(const ClipPlace& place, const PeopleOptions& options) {
  RawPeople raw{.id = place.id, .name = place.files[0], .joints = {}};
  raw.rate_hz = kGvhmrRate;
  raw.up = Axis::kPlusY;
  raw.metres_per_unit = 1.0;
  raw.evidence.emplace_back("layout: GVHMR, smpl_params_global: y up, metres, 30 Hz; shapes are means over the frames");
  add_people(raw,
             {.format = "gvhmr",
              .licence = "",
              .people = {read_gvhmr_person(place.files[0]), read_gvhmr_person(place.files[1])},
              .apart = true},
             options);
  return raw;
}

}  // namespace

const PeopleFormat& gvhmr_format() {
  static const PeopleFormat format{.name = "gvhmr",
                                   .what = "GVHMR: one person a file (hmr4d_results.pt), two paths, --align",
                                   .licence = "",
                                   .recognises = recognises_gvhmr,
                                   .find = find_gvhmr,
                                   .read = read_gvhmr};
  return format;
}

}  // namespace duet
