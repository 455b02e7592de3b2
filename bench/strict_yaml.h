// YAML maps read key by key: what was not asked for is an error that names file, line and the nearest known key.
#pragma once

#include <yaml-cpp/yaml.h>

#include <functional>
#include <string>
#include <vector>

namespace duet {

class StrictMap {
 public:
  // `path` names the map in messages ("clips.synth"); empty for the document. Throws InputError where it is no map.
  StrictMap(YAML::Node node, std::string file, std::string path);

  // The value of `key`, marked as known; an undefined node where it is absent.
  YAML::Node find(const std::string& key);
  [[nodiscard]] bool has(const std::string& key) const;

  // Leave `out` as it is where the key is absent. Throw InputError for a value of another type.
  void get(const std::string& key, std::string& out);
  void get(const std::string& key, double& out);
  void get(const std::string& key, int& out);
  void get(const std::string& key, std::uint64_t& out);
  void get(const std::string& key, bool& out);
  void get(const std::string& key, std::vector<std::string>& out);   // a list, or one scalar
  StrictMap map(const std::string& key);                             // an empty map where absent

  // Runs `read` and adds file, line and key to what it throws (std::invalid_argument).
  void checked(const std::string& key, const std::function<void()>& read);

  // Every entry as text, for maps whose keys are checked elsewhere.
  std::vector<std::pair<std::string, std::string>> entries();

  // Throws InputError for the first key that was never asked for.
  void finish();

  [[nodiscard]] std::string place(const std::string& key) const;     // "suite.yaml:12: key 'clips.synth.seed'"

 private:
  template <typename T>
  void read_scalar(const std::string& key, const char* expected, T& out);

  YAML::Node node_;
  std::string file_, path_;
  std::vector<std::string> known_;
};

// Parses one document. Throws InputError with file, line and the parser's reason.
YAML::Node parse_yaml(const std::string& text, const std::string& file);

}  // namespace duet
