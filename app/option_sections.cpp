#include "duet/app/option_sections.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <numbers>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/external/external_policy.h"

namespace duet {
namespace {

template <typename Option>
std::vector<FieldRow> rows_of(const std::vector<Option>& options) {
  std::vector<FieldRow> rows;
  for (const Option& option : options) {
    const auto end = option.about.find("; ");  // of the values (core/field.h)
    const bool told = end != std::string::npos;
    rows.push_back({option.name, told ? option.about.substr(0, end) : "", option.fallback,
                    told ? option.about.substr(end + 2) : option.about});
  }
  return rows;
}

template <typename Info>
std::vector<OptionSection> sections_of(const std::vector<Info>& infos) {
  std::vector<OptionSection> sections;
  for (const Info& info : infos)
    if (!info.options.empty()) sections.push_back({info.name, rows_of(info.options)});
  return sections;
}

}  // namespace

std::vector<OptionSection> controller_option_sections() {
  std::vector<OptionSection> sections = sections_of(controllers());
  sections.push_back({"every controller", rows_of(common_controller_options())});
  return sections;
}

std::vector<OptionSection> policy_option_sections() {
  std::vector<OptionSection> sections = sections_of(policies());
  for (const PolicyKind kind : {PolicyKind::kOnnx, PolicyKind::kProcess}) {
    PolicyDescriptor descriptor;
    descriptor.kind = kind;
    sections.push_back({kind == PolicyKind::kOnnx ? "descriptor of an ONNX network" : "descriptor of a program",
                        rows_of(external_options(descriptor))});
  }
  sections.push_back({"each of these, replay and controls", rows_of(common_policy_options())});
  return sections;
}

std::vector<OptionSection> engine_option_sections() {
  std::vector<OptionSection> sections;
  for (const EngineInfo& engine : engines()) {
    if (engine.module == nullptr) continue;
    const std::span<const EngineOption> options = engine.module->options;
    sections.push_back(
        {engine.name, field_rows(FieldTable<EngineOptions>(options.begin(), options.end()), EngineOptions())});
  }
  return sections;
}

std::vector<OptionSection> synth_option_sections() {
  return {{"synth", field_rows(synthesis_fields(), SynthesisOptions())}};
}

namespace {

using O = SynthesisOptions;
constexpr FieldRange kHeight = {1.5, 1.95}, kStanding = {0.0, 30.0};

FieldTable<O> draw_fields() {
  constexpr double kThird = std::numbers::pi / 3.0;
  return {
      field<O>({.name = "height_a", .meaning = "height of person A", .unit = "m", .range = kHeight}, &O::height_a),
      field<O>({.name = "height_b", .meaning = "height of person B", .unit = "m", .range = kHeight}, &O::height_b),
      field<O>({.name = "distance",
                .meaning = "of the roots at the start; rehearsed: from 2",
                .unit = "m",
                .range = {0.3, 5.0}},
               &O::distance),
      field<O>(
          {.name = "angle", .meaning = "at which B stands off A's path", .unit = "rad", .range = {-kThird, kThird}},
          &O::angle),
      field<O>({.name = "target_height", .meaning = "of the contact or gesture; its range is the task's", .unit = "m"},
               &O::target_height),
      field<O>({.name = "speed", .meaning = "of walking; rehearsed: from 0.6", .unit = "m/s", .range = {0.3, 1.2}},
               &O::speed),
      field<O>({.name = "style", .meaning = "0 restrained to 1 expansive", .range = {0.0, 1.0}}, &O::style),
      field<O>({.name = "duration", .meaning = "of the whole clip; rehearsed only", .unit = "s", .range = {10.0, 60.0}},
               &O::duration),
      field<O>({.name = "side", .meaning = "hand of the act", .choices = {"left", "right"}}, &O::side)};
}

}  // namespace

const FieldTable<SynthesisOptions>& synthesis_fields() {
  static const FieldTable<O> table = [] {
    FieldTable<O> fields = {
        field<O>({.name = "seed", .meaning = "of everything that is drawn"}, &O::seed),
        field<O>({.name = "first", .meaning = "index of the first clip", .range = {.low = 0}}, &O::index),
        field<O>(
            {.name = "like",
             .meaning = "rehearsed: long acts of two who come from three metres; people: short acts of two who stand "
                        "close, cropped as recordings are; varied: such acts, drawn from more than recordings have",
             .choices = {kLikenessNames.begin(), kLikenessNames.end()}},
            &O::like)};
    for (Field<O>& each : draw_fields()) fields.push_back(std::move(each));
    fields.push_back(field<O>(
        {.name = "before", .meaning = "like people: standing before anything moves", .unit = "s", .range = kStanding},
        &O::before));
    fields.push_back(field<O>(
        {.name = "after", .meaning = "like people: standing after everything", .unit = "s", .range = kStanding},
        &O::after));
    fields.push_back(field<O>({.name = "outcome",
                               .meaning = "like people: how the act goes",
                               .choices = {kActOutcomeNames.begin(), kActOutcomeNames.end()}},
                              &O::outcome));
    fields.push_back(field<O>({.name = "wait",
                               .meaning = "varied: mean of the standing before, drawn without memory",
                               .unit = "s",
                               .range = kStanding},
                              &O::wait));
    fields.push_back(field<O>(
        {.name = "still", .meaning = "varied, of a gesture: whether the partner stands still", .choices = flag_words()},
        &O::still));
    return fields;
  }();
  return table;
}

}  // namespace duet
