#include "duet/bench/suite_clips.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "duet/bench/clips.h"
#include "duet/bench/suite_actors.h"
#include "duet/bench/suite_names.h"
#include "duet/bench/suite_section.h"
#include "duet/core/plain_name.h"
#include "duet/core/require.h"
#include "duet/robots/yaml_fields.h"

namespace duet {
namespace {

const FieldTable<ClipVariant>& variant_fields() {
  static const FieldTable<ClipVariant> table = {
      field<ClipVariant>({.name = "name", .meaning = "follows the clip's id"}, &ClipVariant::name),
      field<ClipVariant>({.name = "side", .choices = choices_of(side_names())}, &ClipVariant::side),
      field<ClipVariant>({.name = "target_height", .unit = "m"}, &ClipVariant::target_height)};
  return table;
}

ClipVariant read_variant(const YAML::Node& node, const std::string& file) {
  const YamlSection item(file, node, "variant", field_keys(variant_fields()));
  ClipVariant variant;
  static_cast<void>(item.text("name"));  // it has to be there
  read_fields(item, variant_fields(), variant);
  if (!is_plain_name(variant.name))
    item.fail(item.line("name"), fmt::format("name: {}", plain_name_message(variant.name)));
  if (!variant.side && !variant.target_height) item.fail(item.line(), "expected side or target_height, found neither");
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

// Paths from the suite's folder; a folder is the files in it. That a file is there is asked when it is read.
void use_clip_files(const YamlSection& clips, Suite& suite) {
  std::vector<std::string> files;
  for (const std::string& file : suite.clips.files) {
    const std::string path = from_folder_of(suite, file);
    try {
      const bool folder = std::filesystem::is_directory(path);
      for (std::string& found : folder ? find_motion_files({path}) : std::vector{path})
        files.push_back(std::move(found));
    } catch (const InputError& error) {
      clips.fail(clips.line("files"), fmt::format("files: {}", error.what()));
    }
  }
  suite.clips.files = std::move(files);
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
      field<SuiteClips>({.name = "seed", .meaning = "of what is synthesised"}, &SuiteClips::synth_seed),
      field<SuiteClips>({.name = "like",
                         .meaning = "which generator: acts rehearsed on a stage, or people as they were recorded",
                         .choices = choices_of(likeness_names())},
                        &SuiteClips::synth_like)};
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

void read_clips(const YamlSection& top, Suite& suite) {
  const YamlSection clips = section_below(top, suite.file, "clips", {"synth", "files", "pad"});
  const YamlSection synth = section_below(clips, suite.file, "synth", {"per_task", "seed", "like", "variants"});
  read_fields(synth, synth_fields(), suite.clips);
  read_variants(synth, suite);
  if (clips.has("files")) suite.clips.files = names_in(clips, "files");
  read_fields(section_below(clips, suite.file, "pad", field_keys(padding_fields())), padding_fields(), suite.clips.pad);
  const bool synthetic = suite.clips.synth_per_task > 0;
  if (synthetic != suite.clips.files.empty())
    clips.fail(clips.line(),
               fmt::format("clips: expected either synth.per_task or files, found {}", synthetic ? "both" : "neither"));
  if (!synthetic && !suite.clips.variants.empty())
    clips.fail(synth.line("variants"), "variants: expected per_task, as only synthesised clips have variants");
  use_clip_files(clips, suite);
}

// What a variant asks of a task that cannot give it is refused here, not when its clips are made.
void check_variants(const YamlSection& top, const Suite& suite) {
  checked(top, "clips", [&] {
    for (const ClipVariant& variant : suite.clips.variants) {
      for (const Task task : suite.tasks) {
        SynthesisOptions options;
        options.side = variant.side;
        options.target_height = variant.target_height;
        check_synthesis_options(task, options);
      }
    }
  });
}

// A padding that is none is not written: suites of before there was one keep their hash.
std::string clips_yaml(const SuiteClips& clips) {
  const std::string pad = clips.pad.any() ? flow_mapping(padding_fields(), clips.pad) : "";
  if (clips.files.empty()) {
    // The first generator goes without saying, as in every suite before there was another.
    const bool first = clips.synth_like == Likeness::kRehearsed;
    const std::string like = first ? "" : fmt::format(", like: {}", name_of(likeness_names(), clips.synth_like));
    return fmt::format("clips: {{synth: {{per_task: {}, seed: {}{}{}}}{}}}\n", clips.synth_per_task, clips.synth_seed,
                       like, variants_yaml(clips.variants), pad.empty() ? "" : ", pad: " + pad);
  }
  std::string text = "clips:\n  files:\n";
  for (const std::string& file : clips.files) text += fmt::format("    - \"{}\"\n", file);
  return pad.empty() ? text : fmt::format("{}  pad: {}\n", text, pad);
}

}  // namespace duet
