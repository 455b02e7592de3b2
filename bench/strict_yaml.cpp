#include "bench/strict_yaml.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/names.h"
#include "core/require.h"

namespace duet {

StrictMap::StrictMap(YAML::Node node, std::string file, std::string path)
    : node_(std::move(node)), file_(std::move(file)), path_(std::move(path)) {
  if (node_.IsDefined() && !node_.IsMap() && !node_.IsNull()) {
    throw InputError(fmt::format("{}:{}: expected a map{}, found {}", file_, node_.Mark().line + 1,
                                 path_.empty() ? "" : fmt::format(" under '{}'", path_),
                                 node_.IsSequence() ? "a list" : "one value"));
  }
}

std::string StrictMap::place(const std::string& key) const {
  const YAML::Node value = std::as_const(node_)[key];
  const int line = (value.IsDefined() ? value.Mark().line : node_.Mark().line) + 1;
  return fmt::format("{}:{}: key '{}{}{}'", file_, line, path_, path_.empty() ? "" : ".", key);
}

YAML::Node StrictMap::find(const std::string& key) {
  known_.push_back(key);
  if (!node_.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
  return std::as_const(node_)[key];
}

bool StrictMap::has(const std::string& key) const { return node_.IsMap() && std::as_const(node_)[key].IsDefined(); }

template <typename T>
void StrictMap::read_scalar(const std::string& key, const char* expected, T& out) {
  const YAML::Node value = find(key);
  if (!value.IsDefined()) return;
  try {
    if (!value.IsScalar()) throw YAML::Exception(value.Mark(), "");
    out = value.as<T>();
  } catch (const YAML::Exception&) {
    throw InputError(fmt::format("{}: expected {}, found {}", place(key), expected,
                                 value.IsScalar() ? fmt::format("'{}'", value.Scalar())
                                                  : std::string(value.IsMap() ? "a map" : "a list")));
  }
}

void StrictMap::get(const std::string& key, std::string& out) { read_scalar(key, "text", out); }
void StrictMap::get(const std::string& key, double& out) { read_scalar(key, "a number", out); }
void StrictMap::get(const std::string& key, int& out) { read_scalar(key, "a whole number", out); }
void StrictMap::get(const std::string& key, bool& out) { read_scalar(key, "true or false", out); }
void StrictMap::get(const std::string& key, std::uint64_t& out) { read_scalar(key, "a whole number, 0 or more", out); }

void StrictMap::get(const std::string& key, std::vector<std::string>& out) {
  const YAML::Node value = find(key);
  if (!value.IsDefined()) return;
  if (value.IsScalar()) {
    out = {value.Scalar()};
    return;
  }
  if (!value.IsSequence()) throw InputError(fmt::format("{}: expected a list, found a map", place(key)));
  out.clear();
  for (const YAML::Node& item : value) {
    if (!item.IsScalar()) {
      throw InputError(fmt::format("{}: expected a list of names, found a nested {}", place(key),
                                   item.IsMap() ? "map" : "list"));
    }
    out.push_back(item.Scalar());
  }
}

StrictMap StrictMap::map(const std::string& key) {
  const YAML::Node value = find(key);
  const std::string path = path_.empty() ? key : path_ + "." + key;
  return {value.IsDefined() ? value : YAML::Node(YAML::NodeType::Map), file_, path};
}

void StrictMap::checked(const std::string& key, const std::function<void()>& read) {
  try {
    read();
  } catch (const std::invalid_argument& error) {
    throw InputError(fmt::format("{}: {}", place(key), error.what()));
  }
}

std::vector<std::pair<std::string, std::string>> StrictMap::entries() {
  std::vector<std::pair<std::string, std::string>> result;
  if (!node_.IsMap()) return result;
  for (const auto& entry : node_) {
    const std::string key = entry.first.as<std::string>();
    std::string value;
    get(key, value);
    result.emplace_back(key, value);
  }
  return result;
}

void StrictMap::finish() {
  if (!node_.IsMap()) return;
  for (const auto& entry : node_) {
    const std::string key = entry.first.as<std::string>();
    if (std::find(known_.begin(), known_.end(), key) == known_.end()) {
      throw InputError(fmt::format("{}:{}: {}", file_, entry.first.Mark().line + 1,
                                   unknown_name_message(path_.empty() ? "key" : "key under '" + path_ + "'", key, known_)));
    }
  }
}

YAML::Node parse_yaml(const std::string& text, const std::string& file) {
  try {
    return YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw InputError(fmt::format("{}:{}: not valid YAML: {}", file, error.mark.line + 1, error.msg));
  }
}

}  // namespace duet
