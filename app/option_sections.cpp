#include "duet/app/option_sections.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "duet/app/synth_options.h"
#include "duet/backends/factory.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/external/external_policy.h"

namespace duet {
namespace {

template <typename Option>
std::vector<FieldRow> rows_of(const std::vector<Option>& options) {
  std::vector<FieldRow> rows;
  for (const Option& option : options) {
    const auto end = option.about.find("; ");  // of the values (core/option.h)
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

std::vector<OptionSection> controller_option_sections() { return sections_of(controllers()); }

std::vector<OptionSection> policy_option_sections() {
  std::vector<OptionSection> sections = sections_of(policies());
  for (const PolicyKind kind : {PolicyKind::kOnnx, PolicyKind::kProcess}) {
    PolicyDescriptor descriptor;
    descriptor.kind = kind;
    sections.push_back({kind == PolicyKind::kOnnx ? "descriptor of an ONNX network" : "descriptor of a program",
                        rows_of(external_options(descriptor))});
  }
  return sections;
}

std::vector<OptionSection> engine_option_sections() {
  std::vector<OptionSection> sections;
  for (const EngineInfo& engine : engines()) {
    if (!engine.available) continue;
    std::vector<FieldRow> rows;
    for (const EngineOption& option : engine_module(engine.name).options) {
      const FieldRange range = {option.low, option.high};
      const std::string values = !option.choices.empty() ? fmt::format("{}", fmt::join(option.choices, ", "))
                                 : option.whole          ? values_of_whole(range, option.low, option.high)
                                                         : values_of_number(range, "");
      rows.push_back({option.name, values, option.value, option.meaning});
    }
    sections.push_back({engine.name, std::move(rows)});
  }
  return sections;
}

std::vector<OptionSection> synth_option_sections() {
  return {{"synth", field_rows(synthesis_fields(), SynthesisOptions())}};
}

}  // namespace duet
