#include "duet/experiment/suite_file/suite_clips.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "duet/core/plain_name.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/suite/suite_names.h"
#include "duet/experiment/suite_file/suite_actors.h"
#include "duet/experiment/suite_file/suite_section.h"
#include "duet/robots/yaml_fields.h"

namespace duet {
namespace {

constexpr const char* kGiven = "given";  // in the place of files: by who runs the suite

const FieldTable<ClipVariant>& variant_fields() {
  static const FieldTable<ClipVariant> table = {
      field<ClipVariant>({.name = "name", .meaning = "follows the clip's id"}, &ClipVariant::name),
      field<ClipVariant>({.name = "side", .choices = choices_of(side_names())}, &ClipVariant::side),
      field<ClipVariant>({.name = "target_height", .unit = "m"}, &ClipVariant::target_height),
      field<ClipVariant>({.name = "distance", .unit = "m"}, &ClipVariant::distance),
      field<ClipVariant>({.name = "outcome", .choices = choices_of(act_outcome_names())}, &ClipVariant::outcome)};
  return table;
}

ClipVariant read_variant(const YAML::Node& node, const std::string& file) {
  const YamlSection item(file, node, "variant", field_keys(variant_fields()));
  ClipVariant variant;
  static_cast<void>(item.text("name"));  // it has to be there
  read_fields(item, variant_fields(), variant);
  if (!is_plain_name(variant.name))
    item.fail(item.line("name"), fmt::format("name: {}", plain_name_message(variant.name)));
  if (!variant.side && !variant.target_height && !variant.distance && !variant.outcome)
    item.fail(item.line(), "expected side, target_height, distance or outcome, found none");
  return variant;
}

void read_variants(const YamlSection& synth, Suite& suite) {
  for (const YAML::Node& node : synth.items("variants")) {
    suite.clips.variants.push_back(read_variant(node, suite.file));
    const std::string& name = suite.clips.variants.back().name;
    const auto same = [&](const ClipVariant& other) { return other.name == name; };
    if (std::count_if(suite.clips.variants.begin(), suite.clips.variants.end(), same) > 1)
      synth.fail(synth.line("variants"), fmt::format("variants: '{}' is there twice; names tell clips apart", name));
  }
}

// The key `files`: paths, or the word `given`.
void read_files(const YamlSection& clips, Suite& suite) {
  if (!clips.has("files")) return;
  suite.clips.given = clips.node("files").IsScalar() && clips.node("files").Scalar() == kGiven;
  if (!suite.clips.given) suite.clips.files = names_in(clips, "files");
}

// Paths from the suite's folder; a folder is the clips in it. That a file is there is asked when it is read.
void use_clip_files(const YamlSection& clips, Suite& suite) {
  std::vector<std::string> files;
  for (const std::string& file : suite.clips.files) {
    const std::string path = from_folder_of(suite, file);
    try {
      const bool folder = std::filesystem::is_directory(path);
      for (std::string& found : folder ? find_clip_files({path}) : std::vector{path}) files.push_back(std::move(found));
    } catch (const InputError& error) {
      clips.fail(clips.line("files"), fmt::format("files: {}", error.what()));
    }
  }
  suite.clips.files = std::move(files);
}

// Checks the keys below `clips` against each other.
void check_clips(const YamlSection& clips, const YamlSection& synth, const SuiteClips& read) {
  const bool synthetic = read.synth_per_task > 0, from_files = read.given || !read.files.empty();
  if (synthetic == from_files)
    clips.fail(clips.line(),
               fmt::format("clips: expected either synth.per_task or files, found {}", synthetic ? "both" : "neither"));
  if (!from_files && read.synth_per_file > 0)
    clips.fail(synth.line("per_file"), "per_file: expected files, for each of which so many clips are synthesised");
  if (!synthetic && !read.variants.empty())
    clips.fail(synth.line("variants"), "variants: expected per_task, as only synthesised clips have variants");
}

std::string variants_yaml(const std::vector<ClipVariant>& variants) {
  if (variants.empty()) return "";
  std::vector<std::string> texts;
  texts.reserve(variants.size());
  for (const ClipVariant& variant : variants) texts.push_back(flow_mapping(variant_fields(), variant));
  return fmt::format(", variants: [{}]", fmt::join(texts, ", "));
}

}  // namespace

const FieldTable<SuiteClips>& synth_fields() {
  static const FieldTable<SuiteClips> table = {
      field<SuiteClips>({.name = "per_task", .meaning = "clips to synthesise for each task", .range = {.low = 1}},
                        &SuiteClips::synth_per_task),
      field<SuiteClips>({.name = "per_file",
                         .meaning = "beside `files`: of each task so many synthesised clips for each of its files, "
                                    "cropped to the act and padded as these are",
                         .range = {.low = 0}},
                        &SuiteClips::synth_per_file),
      field<SuiteClips>({.name = "seed", .meaning = "of what is synthesised"}, &SuiteClips::synth_seed),
      field<SuiteClips>({.name = "like",
                         .meaning = "which generator: acts rehearsed on a stage, or people as they were recorded",
                         .choices = choices_of(likeness_names())},
                        &SuiteClips::synth_like),
      field<SuiteClips>(
          {.name = "tracked", .meaning = "as a depth camera would have them: 15 Hz, centimetres of noise, arms lost"},
          &SuiteClips::synth_tracked)};
  return table;
}

const FieldTable<ClipPadding>& padding_fields() {
  constexpr FieldRange kPadding = {0.0, 60.0};
  static const FieldTable<ClipPadding> table = {
      field<ClipPadding>({.name = "before",
                          .meaning = "both people stand as in their first frame for so long before each clip: for "
                                     "recordings that were cropped to the act. Clips of two people only",
                          .unit = "s",
                          .range = kPadding},
                         &ClipPadding::before),
      field<ClipPadding>({.name = "after", .meaning = "and after it", .unit = "s", .range = kPadding},
                         &ClipPadding::after)};
  return table;
}

const Field<SuiteClips>& roles_field() {
  static const Field<SuiteClips> roles = field<SuiteClips>(
      {.name = "roles",
       .meaning = "whom the robot replaces: whom the clip says, or both people in turn (the id of the "
                  "other one ends in `-A` or `-B`). Clips of two people only",
       .choices = choices_of(role_names())},
      &SuiteClips::roles);
  return roles;
}

void read_clips(const YamlSection& top, Suite& suite) {
  const YamlSection clips = section_below(top, suite.file, "clips", {"synth", "files", "pad", "roles"});
  std::vector<const char*> synth_keys = field_keys(synth_fields());
  synth_keys.push_back("variants");
  const YamlSection synth = section_below(clips, suite.file, "synth", synth_keys);
  read_fields(synth, synth_fields(), suite.clips);
  read_variants(synth, suite);
  read_files(clips, suite);
  read_fields(section_below(clips, suite.file, "pad", field_keys(padding_fields())), padding_fields(), suite.clips.pad);
  read_field(clips, roles_field(), suite.clips);
  check_clips(clips, synth, suite.clips);
  use_clip_files(clips, suite);
}

// Refuses here what a variant asks of a task that cannot give it, not when its clips are made.
void check_variants(const YamlSection& top, const Suite& suite) {
  checked(top, "clips", [&] {
    for (const ClipVariant& variant : suite.clips.variants) {
      for (const Task task : suite.tasks) {
        SynthesisOptions options;
        options.like = suite.clips.synth_like;
        vary(variant, options);
        check_synthesis_options(task, options);
      }
    }
  });
}

namespace {

// The first generator, no tracker and nothing for files go without saying, as in every suite before there were others.
std::string synth_yaml(const SuiteClips& clips) {
  std::string text = clips.synth_per_task > 0 ? fmt::format("{{per_task: {}", clips.synth_per_task)
                                              : fmt::format("{{per_file: {}", clips.synth_per_file);
  text += fmt::format(", seed: {}", clips.synth_seed);
  if (clips.synth_like != Likeness::kRehearsed)
    text += fmt::format(", like: {}", name_of(likeness_names(), clips.synth_like));
  if (clips.synth_tracked) text += ", tracked: true";
  return text + variants_yaml(clips.variants) + "}";
}

std::vector<std::string> files_yaml(const SuiteClips& clips) {
  if (clips.given) return {fmt::format("files: {}", kGiven)};
  if (clips.files.empty()) return {};
  std::string text = "files:\n";
  for (const std::string& file : clips.files)
    text += fmt::format("    - \"{}\"{}", file, &file == &clips.files.back() ? "" : "\n");
  return {text};
}

}  // namespace

// A padding that is none and roles that are the clips' own are not written: suites of before keep their hash.
std::string clips_yaml(const SuiteClips& clips) {
  std::vector<std::string> parts = files_yaml(clips);
  if (clips.synth_per_task > 0 || clips.synth_per_file > 0) parts.push_back("synth: " + synth_yaml(clips));
  if (clips.pad.any()) parts.push_back("pad: " + flow_mapping(padding_fields(), clips.pad));
  if (clips.roles != ClipRoles::kOwn) parts.push_back(fmt::format("roles: {}", name_of(role_names(), clips.roles)));
  if (clips.files.empty()) return fmt::format("{{{}}}", fmt::join(parts, ", "));
  return fmt::format("\n  {}", fmt::join(parts, "\n  "));
}

}  // namespace duet
