#include "duet/execution/run_inputs.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <numeric>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/experiment/suite/suite.h"
#include "duet/robots/card.h"
#include "duet/rows/folder/run_files.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr const char* kInputsSchema = "duet.inputs/1";
constexpr const char* kIndex = "inputs/inputs.json";
constexpr const char* kClips = "clips";  // RunInput::of

std::string in(const std::string& folder, const std::string& file) { return (fs::path(folder) / file).string(); }

std::string from_folder(const std::string& path, const std::string& folder) {
  return fs::absolute(path).lexically_normal().lexically_proximate(fs::absolute(folder).lexically_normal()).string();
}

// A path without a way out of the folder that it starts at.
bool stays_below(const fs::path& path) {
  const fs::path normal = path.lexically_normal();
  return !normal.empty() && normal.is_relative() && *normal.begin() != "..";
}

// The lowest folder that has all files below it.
std::string common_folder(const std::vector<std::string>& files) {
  fs::path folder = fs::absolute(files.front()).lexically_normal().parent_path();
  const auto is_outside = [&](const std::string& file) { return !stays_below(from_folder(file, folder.string())); };
  while (folder.has_relative_path() && std::ranges::any_of(files, is_outside)) folder = folder.parent_path();
  return folder.string();
}

// A card that ships with duet goes by its name.
bool is_shipped_card(const fs::path& card) {
  std::error_code ignored;
  try {
    return fs::equivalent(card_path(card.stem().string()), card, ignored);
  } catch (const MissingError&) {
    return false;
  }
}

// The card by which a controller's descriptor names its robot, where that is a path; "" otherwise.
std::string card_by_path(const SuitePolicy&) { return ""; }
std::string card_by_path(const SuiteController& controller) {
  if (!controller.use.ends_with(".yaml")) return "";
  const std::string robot = load_descriptor(controller.use).robot;
  return robot.ends_with(".yaml") ? robot : "";
}

// The card first, then what it extends, and its URDF where that lies below the card's folder; others are found as
// networks are.
std::vector<std::string> files_of_card(const std::string& path) {
  const RobotCard card = parse_card(read_file(path), path);
  std::vector<std::string> files = card.files;
  if (const fs::path urdf = fs::path(path).parent_path() / card.urdf; fs::exists(urdf)) files.push_back(urdf.string());
  return files;
}

class InputArchive {
 public:
  InputArchive(Suite suite, const std::string& folder, FileDigests files) : folder_(folder), files_(std::move(files)) {
    kept_.suite = std::move(suite);
  }

  ArchivedSuite keep() {
    keep_clips();
    if (!kept_.suite.contact_limits.empty())
      kept_.suite.contact_limits = copy("contact_limits", "", kept_.suite.contact_limits, "inputs/contact_limits.yaml");
    keep_robot();
    for (SuitePolicy& policy : kept_.suite.policies) keep_actor("policy", policy);
    for (SuiteController& controller : kept_.suite.controllers) keep_actor("controller", controller);
    return std::move(kept_);
  }

 private:
  std::string copy(const std::string& of, const std::string& role, const std::string& from, const std::string& to) {
    kept_.copies.push_back({from, to, files_.of(from)});
    kept_.inputs.push_back({of, role, to, files_.of(from), true});
    return to;
  }

  void keep_clips() {
    std::vector<std::string>& files = kept_.suite.clips.files;
    const std::uintmax_t bytes = std::accumulate(
        files.begin(), files.end(), std::uintmax_t{0},
        [](std::uintmax_t sum, const std::string& file) { return sum + (fs::exists(file) ? fs::file_size(file) : 0); });
    for (std::size_t i = 0; i < files.size(); ++i) {
      const std::string name = fs::path(files[i]).filename().string();
      if (bytes <= kMostClipBytes) {
        files[i] = copy(kClips, "", files[i], fmt::format("inputs/clips/{:04}_{}", i, name));
      } else {
        kept_.inputs.push_back({kClips, "", name, files_.of(files[i]), false});
        files[i] = from_folder(files[i], folder_);
      }
    }
  }

  void keep_robot() {
    std::string& robot = kept_.suite.robot;
    if (robot.empty()) return;
    const fs::path card(robot);
    if (is_shipped_card(card)) {
      robot = card.stem().string();
      return;
    }
    const std::vector<std::string> files = files_of_card(robot);
    const std::string folder = common_folder(files);
    for (const std::string& file : files) copy("robot", "", file, "inputs/robot/" + from_folder(file, folder));
    robot = "inputs/robot/" + from_folder(files.front(), folder);
  }

  template <typename Actor>
  void keep_actor(const std::string& kind, Actor& actor) {
    const std::string of = fmt::format("{} {}", kind, actor.name);
    const std::string place = fmt::format("inputs/{}/{}/", kind == "policy" ? "policies" : "controllers", actor.name);
    const bool descriptor = actor.use.ends_with(".yaml");
    // A descriptor and the card that it names by a path stay as far from each other as they are.
    std::string folder = fs::path(actor.use).parent_path().string();
    if (const std::string card = card_by_path(actor); !card.empty()) {
      std::vector<std::string> cards = files_of_card(card);
      cards.push_back(actor.use);
      folder = common_folder(cards);
      cards.pop_back();
      for (const std::string& file : cards) copy(of, "robot", file, place + from_folder(file, folder));
    }
    const std::vector<HashedFile> files = identity_of(actor, files_).files;
    if (files.empty() && descriptor)  // its network is absent
      actor.use = copy(of, "descriptor", actor.use, place + from_folder(actor.use, folder));
    for (const HashedFile& file : files) {
      const std::string name = fs::path(file.path).filename().string();
      if (descriptor && file.role == "descriptor") {
        actor.use = copy(of, file.role, file.path, place + from_folder(file.path, folder));
      } else if (file.role.starts_with("command ")) {
        copy(of, file.role, file.path, place + file.role.substr(8));
      } else {
        kept_.inputs.push_back({of, file.role, name, file.sha256, false});
        const bool named = actor.options.contains(file.role) && fs::exists(actor.options.at(file.role));
        const bool beside = descriptor && file.role == "network";  // of the descriptor, which is copied without it
        if (named || beside) actor.options[file.role] = from_folder(file.path, folder_);
      }
    }
  }

  std::string folder_;
  FileDigests files_;
  ArchivedSuite kept_;
};

// inputs/inputs.json.
struct InputIndex {
  std::vector<RunInput> files;
};

}  // namespace

template <>
const JsonSchema<RunInput>& json_schema<RunInput>() {
  using I = RunInput;
  static const JsonSchema<I> schema = {
      {{"of"}, &I::of}, {{"role"}, &I::role}, {{"file"}, &I::file}, {{"sha256"}, &I::sha256}, {{"kept"}, &I::kept}};
  return schema;
}

template <>
const JsonSchema<InputIndex>& json_schema<InputIndex>() {
  static const JsonSchema<InputIndex> schema = {{{"files"}, &InputIndex::files}};
  return schema;
}

namespace {

std::string index_text(const std::vector<RunInput>& inputs) {
  return dumped(json_document(kInputsSchema, InputIndex{inputs}), 2) + "\n";
}

void check_kept(const RunInput& input, const std::string& folder) {
  const std::string path = in(folder, input.file);
  const std::string found = sha256_file(path);
  if (found != input.sha256)
    throw InputError(fmt::format("{}: SHA-256 expected {}, found {}: it is not what the run was made from", path,
                                 input.sha256, found));
}

std::vector<std::string> shipped_places(const std::string& name) {
  std::vector<std::string> places;
  for (const char* folder : {"policies/dstar/", "controllers/wbc_sim/"}) {
    try {
      places.push_back(share_file("network", folder + name));
    } catch (const MissingError&) {
      continue;  // of another name than those that ship
    }
  }
  return places;
}

// The places where a network of that name may be, the likeliest first.
std::vector<std::string> places_of(const RunInput& input, const std::string& now, const std::string& folder) {
  std::vector<std::string> places;
  if (!now.empty()) places.push_back(now);
  // A controller that ships is found by name, and what lies beside a network is found with it.
  if (input.role == "descriptor" || input.role.starts_with("network data ")) return places;
  for (const char* below : {".", "inputs"})
    places.push_back((fs::path(folder) / below / input.file).lexically_normal());
  for (const std::string& place : shipped_places(input.file)) places.push_back(place);
  if (const char* models = std::getenv("DUET_MODELS"); models != nullptr && *models != '\0')
    places.push_back(in(models, input.file));
  return places;
}

// The first of `places` that holds what the run was made from.
std::string find_again(const RunInput& input, const std::vector<std::string>& places) {
  std::vector<std::string> found;
  for (const std::string& place : places) {
    if (!fs::is_regular_file(place)) continue;
    const std::string digest = sha256_file(place);
    if (digest == input.sha256) return place;
    found.push_back(fmt::format("{} in {}", digest, place));
  }
  const std::string expected =
      fmt::format("{}: {} '{}': expected SHA-256 {}", input.of, input.role, input.file, input.sha256);
  if (found.empty() && places.empty())  // of an actor that does not load
    throw MissingError(expected + ", found none: its network is not on this machine (DUET_MODELS, DUET_SHARED)");
  if (found.empty()) throw MissingError(fmt::format("{}, found none: looked at {}", expected, fmt::join(places, ", ")));
  throw InputError(fmt::format("{}, found {}", expected, fmt::join(found, ", ")));
}

// The place where the actor finds its file on this machine; "" where it finds none.
template <typename Actor>
std::string place_now(Actor actor, const std::string& role) {
  const auto given = actor.options.find(role);
  if (given != actor.options.end() && fs::path(given->second).is_absolute() && !fs::exists(given->second)) {
    if (!actor.use.ends_with(".yaml")) return "";
    actor.options.erase(given);  // a descriptor may find it by itself
  }
  for (const HashedFile& file : identity_of(actor).files)
    if (file.role == role) return file.path;
  return "";
}

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

template <typename Actor>
void find_files(const char* kind, std::vector<Actor>& actors, const std::vector<std::string>& skipped,
                const std::vector<RunInput>& inputs, const std::string& folder) {
  for (Actor& actor : actors) {
    if (contains(skipped, actor.name)) continue;
    for (const RunInput& input : inputs) {
      if (input.kept || input.of != fmt::format("{} {}", kind, actor.name)) continue;
      const std::string now = place_now(actor, input.role);
      const std::string place = find_again(input, places_of(input, now, folder));
      if (place != now || actor.options.contains(input.role)) actor.options[input.role] = place;
    }
  }
}

// {SHA-256: file} of the files below a folder, or of one file.
std::map<std::string, std::string> by_digest(const std::string& place) {
  std::map<std::string, std::string> files;
  if (fs::is_regular_file(place)) files[sha256_file(place)] = place;
  if (!fs::is_directory(place)) return files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(place))
    if (entry.is_regular_file()) files[sha256_file(entry.path().string())] = entry.path().string();
  return files;
}

// Each clip that the run does not keep: where the suite names it, else the file below `given` that has its bytes.
void find_clips(std::vector<std::string>& files, const std::vector<RunInput>& inputs, const std::string& given,
                const std::string& folder) {
  std::map<std::string, std::string> found;
  if (!given.empty() && (found = by_digest(given)).empty())
    throw InputError(fmt::format("'{}': expected the clips of '{}', found no file", given, folder));
  std::size_t i = 0;
  for (const RunInput& input : inputs) {
    if (input.of != kClips) continue;
    if (i == files.size())
      throw InputError(fmt::format("{}: expected {} clips, as suite.yaml names, found more", in(folder, kIndex), i));
    std::string& file = files[i++];
    if (input.kept) continue;
    if (const auto other = found.find(input.sha256); other != found.end()) {
      file = other->second;
    } else if (!fs::exists(file)) {
      throw MissingError(fmt::format(
          "'{}' is without its clips: expected {} with the SHA-256 {}, found none{}", folder, input.file, input.sha256,
          given.empty() ? "; say where they are with --clips" : fmt::format(" below '{}'", given)));
    } else if (const std::string digest = sha256_file(file); digest != input.sha256) {
      throw InputError(fmt::format("{}: SHA-256 expected {}, found {}", file, input.sha256, digest));
    }
  }
}

[[noreturn]] void fail_place(const std::string& of, const std::string& expected, const std::string& named,
                             const std::string& folder) {
  throw InputError(
      fmt::format("{}: {}: expected {}, found '{}'", in(folder, "suite.yaml"), of, expected, excerpt(named)));
}

// A file that the run keeps is the one that suite.yaml names.
void require_kept_place(const RunInput& input, const std::string& named, const std::string& folder) {
  if (input.kept && from_folder(named, folder) != fs::path(input.file).lexically_normal().string())
    fail_place(input.of, fmt::format("the file '{}' that the run keeps", excerpt(input.file)), named, folder);
}

// Requires the places of what is read for tables and pages; policies and controllers are found by their digests.
void require_kept_places(const Suite& suite, const std::vector<RunInput>& inputs, const std::string& folder) {
  std::vector<const RunInput*> clips;
  std::map<std::string, const RunInput*> first;
  for (const RunInput& input : inputs) {
    if (input.of == kClips) clips.push_back(&input);
    first.emplace(input.of, &input);
  }
  for (std::size_t i = 0; i < std::min(clips.size(), suite.clips.files.size()); ++i)
    require_kept_place(*clips[i], suite.clips.files[i], folder);
  for (const auto& [of, named] : {std::pair{"contact_limits", &suite.contact_limits}, {"robot", &suite.robot}}) {
    if (named->empty() || is_shipped_card(*named)) continue;
    if (!first.contains(of)) fail_place(of, "a file that inputs/inputs.json lists", *named, folder);
    require_kept_place(*first.at(of), *named, folder);
  }
}

template <typename Actor>
void rebase_actor(Actor& actor, const std::function<void(std::string&)>& rebase) {
  if (actor.use.ends_with(".yaml")) rebase(actor.use);
  for (auto& [name, value] : actor.options)
    if (is_path_option(name) && fs::path(value).is_absolute()) rebase(value);
}

}  // namespace

std::vector<RunInput> read_inputs(const std::string& folder) {
  const std::string path = in(folder, kIndex);
  std::vector<RunInput> inputs = read_document<InputIndex>(read_file(path), path, kInputsSchema).files;
  for (const RunInput& input : inputs)
    if (input.kept && !stays_below(input.file))
      throw InputError(fmt::format("{}: key 'file': expected a path below the run directory, found '{}'", path,
                                   excerpt(input.file)));
  return inputs;
}

Suite rebased(Suite suite, const std::string& from, const std::string& to) {
  const auto rebase = [&](std::string& path) {
    const std::string below = from_folder(path, from);
    path = stays_below(below) ? below : from_folder(path, to);
  };
  for (std::string& file : suite.clips.files) rebase(file);
  if (!suite.contact_limits.empty()) rebase(suite.contact_limits);
  if (is_shipped_card(suite.robot))
    suite.robot = fs::path(suite.robot).stem().string();
  else if (!suite.robot.empty())
    rebase(suite.robot);
  for (SuitePolicy& policy : suite.policies) rebase_actor(policy, rebase);
  for (SuiteController& controller : suite.controllers) rebase_actor(controller, rebase);
  return suite;
}

ArchivedSuite archive_inputs(Suite suite, const std::string& folder, const FileDigests& files) {
  return InputArchive(std::move(suite), folder, files).keep();
}

void keep_inputs(const ArchivedSuite& kept, const std::string& folder) {
  for (const ArchivedSuite::Copy& copy : kept.copies) {
    const std::string to = join_without_links(folder, copy.to);
    if (fs::exists(to)) continue;
    const std::string bytes = read_file(copy.from);
    if (sha256_hex(bytes) != copy.sha256)
      throw InputError(fmt::format("'{}' was replaced since the run has loaded it: begin again", copy.from));
    write_file(to, bytes);
    fs::permissions(to, fs::status(copy.from).permissions() | fs::perms::owner_write);
  }
  if (const std::string index = join_without_links(folder, kIndex); !fs::exists(index))
    write_file(index, index_text(kept.inputs));
}

bool has_inputs(const std::string& folder) { return fs::exists(in(folder, kIndex)); }

Suite suite_of_head(const Run& run) {
  Suite suite = parse_run_suite(run.info.suite_yaml, in(run.path, "suite.yaml"));
  require_kept_places(suite, has_inputs(run.path) ? read_inputs(run.path) : std::vector<RunInput>(), run.path);
  return suite;
}

std::string clips_fault(const Run& run, const std::vector<std::string>& clips) {
  if (clips.empty()) return "";
  if (!has_inputs(run.path)) return "the run has no index of what it was made from";
  std::size_t i = 0;
  for (const RunInput& input : read_inputs(run.path)) {
    if (input.of != kClips || i == clips.size()) continue;
    const std::string& file = clips[i++];
    const std::string name = excerpt(fs::path(file).filename().string());
    if (!fs::exists(file)) return fmt::format("'{}' is not there", name);
    if (sha256_file(file) != input.sha256) return fmt::format("'{}' is not what the run was made from", name);
  }
  return i < clips.size() ? "the run's index does not list all of them" : "";
}

Suite suite_of_run(const Run& run, const InputPlaces& places) {
  const std::vector<RunInput> inputs = read_inputs(run.path);
  for (const RunInput& input : inputs)
    if (input.kept) check_kept(input, run.path);
  Suite suite = suite_of_head(run);
  find_clips(suite.clips.files, inputs, places.clips, run.path);
  find_files("policy", suite.policies, places.skipped_policies, inputs, run.path);
  find_files("controller", suite.controllers, places.skipped_controllers, inputs, run.path);
  return suite;
}

PublishedInputs published_inputs(const std::string& run, bool without_clips) {
  PublishedInputs published;
  if (!has_inputs(run)) return published;
  require_plain_files(run);
  std::vector<RunInput> inputs = read_inputs(run);
  for (RunInput& input : inputs) {
    if (without_clips && input.of == kClips) input.kept = false;
    if (!input.kept) continue;
    check_kept(input, run);
    published.files.insert(fs::path(input.file).lexically_normal().generic_string());
  }
  published.texts[kIndex] = index_text(inputs);
  return published;
}

}  // namespace duet
