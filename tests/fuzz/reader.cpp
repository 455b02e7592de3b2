#include "tests/fuzz/reader.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace duet::fuzz {

std::vector<Reader> all_readers() {
  std::vector<Reader> all;
  for (const auto& room : {core_readers, format_readers, motion_readers, body_readers, robot_readers, network_readers,
                           controller_readers, policy_readers, result_readers, dataset_readers, bench_readers,
                           training_readers, guard_readers, hardware_readers})
    for (const Reader& reader : room()) all.push_back(reader);
  return all;
}

std::string scratch_folder() {
  static const std::string path = [] {
    const std::string name = std::filesystem::temp_directory_path() / ("duet-fuzz-" + std::to_string(getpid()));
    std::filesystem::create_directories(name);
    return name;
  }();
  return path;
}

std::string scratch_file(const std::string& name, std::string_view bytes) {
  const std::string path = scratch_folder() + "/" + name;
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

std::vector<std::string_view> parts(std::string_view bytes, std::size_t count) {
  std::vector<std::string_view> found;
  while (found.size() + 1 < count) {
    const std::size_t end = std::min(bytes.find(kSeparator), bytes.size());
    found.push_back(bytes.substr(0, end));
    bytes.remove_prefix(std::min(end + kSeparator.size(), bytes.size()));
  }
  found.push_back(bytes);
  return found;
}

}  // namespace duet::fuzz
