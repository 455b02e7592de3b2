#include "duet/rollout/perturbations/perturbation_kind.h"

namespace duet {

PerturbationKind valued_kind(const std::string& name, std::string meaning, const Field<Perturbation>& value,
                             const std::string& fallback) {
  PerturbationKind kind{name, std::move(meaning), {{value.name, value.values, fallback, value.meaning}}, {}, {}};
  kind.read = [name, value, fallback](const YamlSection& item, const std::string& file, Perturbation& into) {
    const YamlSection mapping(file, item.node(name.c_str()), name, {value.name.c_str()});
    set_field(value, into, fallback);
    read_field(mapping, value, into);
  };
  kind.write = [value](const Perturbation& of) {
    const std::string text = value.text(of);
    return text == value.text(Perturbation()) ? "" : '{' + value.name + ": " + text + '}';
  };
  kind.values = [value](const Perturbation& of) { return FieldTexts{{value.name, value.text(of)}}; };
  return kind;
}

PerturbationKind plain_kind(const Field<Perturbation>& value, const std::string& fallback) {
  PerturbationKind kind{value.name, value.meaning, {{"", value.values, fallback, ""}}, {}, value.text, fallback};
  kind.read = [value](const YamlSection& item, const std::string&, Perturbation& into) {
    read_field(item, value, into);
  };
  return kind;
}

}  // namespace duet
