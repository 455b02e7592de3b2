#include "duet/rollout/perturbations/perturbation_kind.h"

namespace duet {

PerturbationKind valued_kind(const std::string& name, std::string meaning, const Field<Perturbation>& value,
                             const std::string& fallback) {
  const auto read = [=](const SchemaSection& item, Perturbation& into) {
    const YamlSection mapping(item.file, item.node(name.c_str()), name, {value.name.c_str()});
    set_field(value, into, fallback);
    read_field(mapping, value, into);
  };
  const auto write = [value](const Perturbation& of) {
    const std::string text = value.text(of);
    return text == value.text(Perturbation()) ? "" : '{' + value.name + ": " + text + '}';
  };
  PerturbationKind kind(name, std::move(meaning), read, {{value.name, value.values, fallback, value.meaning}}, write);
  kind.values = [value](const Perturbation& of) { return FieldTexts{{value.name, value.text(of)}}; };
  return kind;
}

PerturbationKind plain_kind(const Field<Perturbation>& value, const std::string& fallback) {
  PerturbationKind kind(value.name, value.meaning, field_key(value).read, {{"", value.values, fallback, ""}},
                        value.text);
  kind.fallback = fallback;
  return kind;
}

}  // namespace duet
