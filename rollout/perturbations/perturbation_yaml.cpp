// Reads, writes and lists perturbations by the table of their kinds.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "duet/core/names.h"
#include "duet/core/plain_name.h"
#include "duet/core/require.h"
#include "duet/robots/yaml_tags.h"
#include "duet/rollout/perturbations/perturbation.h"
#include "duet/rollout/perturbations/perturbation_kinds.h"

namespace duet {
namespace {

std::vector<std::string> kinds_of(const YamlSection& item) {
  std::vector<std::string> names;
  for (const PerturbationKind& known : perturbation_kind_table())
    if (item.has(known.name.c_str())) names.push_back(known.name);
  return names;
}

Perturbation read_kinds(const SchemaSection& item) {
  Perturbation perturbation;
  for (const PerturbationKind& known : perturbation_kind_table())
    if (item.has(known.name.c_str())) known.read(item, perturbation);
  return perturbation;
}

std::vector<const char*> keys_of_item() {
  std::vector<const char*> keys = {"name", kTagsKey};
  for (const PerturbationKind& known : perturbation_kind_table()) keys.push_back(known.name.c_str());
  return keys;
}

Perturbation read_item(const YamlSection& suite, const YAML::Node& node, const std::string& file) {
  const int line = std::max(node.Mark().line, 0) + 1;
  if (node.IsScalar()) {
    try {
      return default_perturbation(node.Scalar());
    } catch (const std::invalid_argument& error) {
      suite.fail(line, fmt::format("perturbations: {}", error.what()));
    }
  }
  const SchemaSection item(file, node, "perturbation", keys_of_item());
  const std::vector<std::string> named = kinds_of(item);
  if (named.empty())
    item.fail(line, fmt::format("expected at least one of {}, found none", fmt::join(perturbation_kinds(), ", ")));
  Perturbation perturbation = read_kinds(item);
  perturbation.tags = read_tags(item, kOfPerturbation);
  perturbation.name = item.has("name") ? item.text("name") : fmt::format("{}", fmt::join(named, "+"));
  if (perturbation.name == kCleanName) item.fail(item.line("name"), "name: 'clean' is the arm without a perturbation");
  if (!is_plain_name(perturbation.name))
    item.fail(item.line("name"), fmt::format("name: {}", plain_name_message(perturbation.name)));
  return perturbation;
}

}  // namespace

const std::vector<std::string>& perturbation_kinds() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const PerturbationKind& known : perturbation_kind_table()) all.push_back(known.name);
    return all;
  }();
  return names;
}

Perturbation default_perturbation(const std::string& kind) {
  if (kind == kCleanName) return {};
  for (const PerturbationKind& known : perturbation_kind_table()) {
    if (known.name != kind) continue;
    const YAML::Node item = YAML::Load(fmt::format("{{{}: {}}}", kind, known.fallback));
    Perturbation perturbation = read_kinds({kind, item, "perturbation", {known.name.c_str()}});
    perturbation.name = kind;
    return perturbation;
  }
  std::vector<std::string> names = perturbation_kinds();
  names.insert(names.begin(), kCleanName);
  throw std::invalid_argument(unknown_name_message("perturbation", kind, names));
}

std::vector<Perturbation> read_perturbations(const YamlSection& suite, const std::string& file) {
  if (!suite.has("perturbations")) return {Perturbation{}};
  std::vector<Perturbation> list;
  for (const YAML::Node& node : suite.items("perturbations")) {
    list.push_back(read_item(suite, node, file));
    const auto same = [&](const Perturbation& other) { return other.name == list.back().name; };
    if (std::count_if(list.begin(), list.end(), same) > 1)
      suite.fail(std::max(node.Mark().line, 0) + 1,
                 fmt::format("perturbations: '{}' is there twice; names tell rows apart", list.back().name));
  }
  if (list.empty()) suite.fail(suite.line("perturbations"), "perturbations: expected at least one, found none");
  return list;
}

std::string to_yaml(const Perturbation& perturbation) {
  std::vector<std::string> parts = {fmt::format("name: {}", perturbation.name)};
  for (const PerturbationKind& known : perturbation_kind_table())
    if (const std::string value = known.write(perturbation); !value.empty())
      parts.push_back(fmt::format("{}: {}", known.name, value));
  return parts.size() == 1 ? perturbation.name
                           : fmt::format("{{{}{}}}", fmt::join(parts, ", "), tags_yaml(perturbation.tags));
}

}  // namespace duet
