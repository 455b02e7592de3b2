// A robot card and its URDF, separated by a line "====", as two files.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "robots/robot_model.h"
#include "tests/fuzz/reader.h"
#include "tests/robots/fixtures.h"

namespace {

constexpr std::string_view kSeparator = "\n====\n";

const std::string& sample() {
  static const std::string text = duet::test::kSmallCard + std::string(kSeparator) + duet::test::kSmallUrdf;
  return text;
}

const std::string& folder() {
  static const std::string path = [] {
    const std::string name = std::filesystem::temp_directory_path() / ("duet-fuzz-" + std::to_string(getpid()));
    std::filesystem::create_directories(name);
    return name;
  }();
  return path;
}

void write(const std::string& name, std::string_view text) {
  std::ofstream(folder() + "/" + name, std::ios::binary) << text;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  return duet::fuzz::mutate(data, size, max_size, seed, sample());
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = duet::fuzz::text_of(data, size);
  const std::size_t split = std::min(text.find(kSeparator), size);
  write("card.yaml", text.substr(0, split));
  write("small.urdf", text.substr(std::min(split + kSeparator.size(), size)));
  return duet::fuzz::read_or_refuse([&] { (void)duet::load_robot(folder() + "/card.yaml", folder() + "/small.urdf"); });
}
