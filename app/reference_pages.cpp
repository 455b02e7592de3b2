#include "duet/app/reference_pages.h"

#include <fmt/format.h>

#include <utility>

#include "duet/app/option_sections.h"
#include "duet/app/part.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/suite_file/suite_key.h"
#include "duet/io/channel.h"
#include "duet/retarget/options.h"
#include "duet/rollout/perturbations/perturbation_kind.h"
#include "duet/rows/groups/database.h"

namespace duet {
namespace {

constexpr const char* kMadeBy = "Made by `duet list {} --markdown` from the table that the program reads with.\n\n";

struct PageMaker {
  const char* name;
  std::string (*make)();
};

// A cell of a Markdown table: as code, or "-" where there is nothing.
std::string code(const std::string& text) { return text.empty() ? "-" : '`' + text + '`'; }

std::string head(const std::string& title, const std::string& name, const std::string& about) {
  return fmt::format("# {}\n\n{}\n\n{}", title, about, fmt::format(fmt::runtime(kMadeBy), name));
}

std::string suite_page() {
  std::string text =
      head(
          "Keys of a suite", "suite-keys",
          "A suite is a YAML file ([file-formats.md](../file-formats.md#suite)). Beside `reference` the keys of clips, "
          "policies and people are refused.") +
      "| key | default | value | meaning |\n|---|---|---|---|\n";
  for (const SuiteKey& key : suite_keys())
    for (const FieldRow& row : key.rows)
      text += fmt::format("| `{}` | {} | {} | {} |\n", row.name, row.fallback.empty() ? "-" : row.fallback, row.values,
                          row.meaning);
  return text;
}

std::string perturbation_page() {
  std::string text = head("Perturbations", "perturbations",
                          "Kinds of perturbation of a suite ([file-formats.md](../file-formats.md#perturbations)).");
  for (const PerturbationKind& kind : perturbation_kind_table()) {
    text +=
        fmt::format("## {}\n\n{}. By its name alone: `{}`.\n\n| key | default | value | meaning |\n|---|---|---|---|\n",
                    kind.name, kind.meaning, to_yaml(default_perturbation(kind.name)));
    for (const FieldRow& row : kind.rows)
      text += fmt::format("| {} | {} | {} | {} |\n", code(row.name), code(row.fallback), row.values,
                          row.meaning.empty() ? "-" : row.meaning);
    text += '\n';
  }
  text.pop_back();
  return text;
}

std::string pair_page() {
  std::string text =
      head("Options of PAIR", "pair-options",
           "For `duet retarget --option NAME=VALUE` and the key `retarget` of a suite. Defaults are those "
           "of the mode `paper`; [retargeting.md](../retargeting.md) tells the modes apart.") +
      "| option | default | value | meaning |\n|---|---|---|---|\n";
  for (const FieldRow& row : field_rows(pair_option_table(), PairOptions()))
    text += fmt::format("| `{}` | {} | {} | {} |\n", row.name, code(row.fallback), row.values, row.meaning);
  return text;
}

std::string channel_page() {
  std::string text =
      head("Channels", "channels",
           "What networks and programs are shown, by the names that IO descriptors "
           "([file-formats.md](../file-formats.md#io-descriptor)), policy descriptors "
           "([a policy](../extending.md#a-policy)) and the headers of duet's own networks have for it. Keys: of "
           "an IO descriptor, beside `channel`, `scale` and `clip`.") +
      "| IO descriptor | policy | network | numbers | keys | meaning |\n|---|---|---|---|---|---|\n";
  for (const ChannelRow& row : channel_table()) {
    std::string keys;
    for (const std::string& key : channel_keys(row.kind)) keys += (keys.empty() ? "" : ", ") + code(key);
    text += fmt::format("| {} | {} | {} | {} | {} | {} |\n", code(row.controller), code(row.policy), code(row.network),
                        row.numbers, keys.empty() ? "-" : keys, row.meaning);
  }
  return text;
}

std::string option_page(const std::string& title, const std::string& name, const std::string& about,
                        const std::vector<OptionSection>& sections) {
  std::string text = head(title, name, about);
  for (const OptionSection& section : sections) {
    text += fmt::format("## {}\n\n| option | default | value | meaning |\n|---|---|---|---|\n", section.name);
    for (const FieldRow& row : section.rows)
      text += fmt::format("| `{}` | {} | {} | {} |\n", row.name, code(row.fallback), row.values,
                          row.meaning.empty() ? "-" : row.meaning);
    text += '\n';
  }
  text.pop_back();
  return text;
}

std::string controller_options_page() {
  return option_page(
      "Options of controllers", "controller-options",
      "For the key `options` in a suite's `controllers`, as `{name: locked, use: homie, options: {waist: locked}}`. "
      "Controllers that are not here have none.",
      controller_option_sections());
}

std::string policy_options_page() {
  return option_page("Options of policies", "policy-options",
                     "For the key `options` in a suite's `policies`, as `{name: firm, use: dstar, options: "
                     "{temperature: 0.5}}`. Policies "
                     "that are not here have none.",
                     policy_option_sections());
}

std::string engine_options_page() {
  return option_page(
      "Options of engines", "engine-options",
      "For an engine profile ([file-formats.md](../file-formats.md#engine-profile)), of the engines that "
      "are there.",
      engine_option_sections());
}

std::string synth_options_page() {
  return option_page("Options of synthesis", "synth-options",
                     "For `duet synth`, as `--height-a 1.7`. What has no default is drawn "
                     "([synthesis.md](../synthesis.md)).",
                     synth_option_sections());
}

std::string train_options_page() {
  return option_page("Options of training", "train-options",
                     "For `duet train wbc`, and for `duet train dstar`, its variants and `retrieval`; as "
                     "`--round-clips 120`.",
                     in_parts(&Part::option_lists, "train-options")());
}

std::string row_fields_page() {
  std::string text =
      head(
          "Fields of an episode row", "row-fields",
          "A line of `episodes.jsonl` ([file-formats.md](../file-formats.md#episode-row)). The last column says in "
          "which "
          "columns of the table `episodes` a field stands in `results.sqlite`; mappings and lists have tables of their "
          "own.") +
      "| key | type | meaning | SQLite |\n|---|---|---|---|\n";
  std::string parts;
  for (const RowFieldInfo& info : row_field_list()) {
    std::string columns;
    for (const std::string& column : info.columns) columns += (columns.empty() ? "" : ", ") + code(column);
    text +=
        fmt::format("| `{}` | {} | {} | {} |\n", info.name, info.type, info.meaning, columns.empty() ? "-" : columns);
    if (info.members.empty()) continue;
    parts += fmt::format("\n## {}\n\n| key | type | meaning |\n|---|---|---|\n", info.name);
    for (const RowFieldInfo& member : info.members)
      parts += fmt::format("| `{}` | {} | {} |\n", member.name, member.type, member.meaning);
  }
  return text + parts;
}

constexpr PageMaker kPages[] = {{"suite-keys", suite_page},
                                {"perturbations", perturbation_page},
                                {"pair-options", pair_page},
                                {"channels", channel_page},
                                {"controller-options", controller_options_page},
                                {"policy-options", policy_options_page},
                                {"engine-options", engine_options_page},
                                {"synth-options", synth_options_page},
                                {"train-options", train_options_page},
                                {"row-fields", row_fields_page}};

// A page of a part has nothing to show where the part is absent.
bool is_here(const PageMaker& page) {
  return page.make != train_options_page || in_parts(&Part::option_lists, page.name) != nullptr;
}

}  // namespace

std::vector<std::string> reference_page_names() {
  std::vector<std::string> names;
  names.reserve(std::size(kPages));
  for (const PageMaker& page : kPages)
    if (is_here(page)) names.emplace_back(page.name);
  return names;
}

std::string reference_page(const std::string& name) {
  for (const PageMaker& page : kPages) {
    if (name != page.name) continue;
    if (!is_here(page)) throw MissingError(missing_part_message(fmt::format("`duet list {}`", name), "training"));
    return page.make();
  }
  throw std::invalid_argument(unknown_name_message("reference page", name, reference_page_names()));
}

}  // namespace duet
