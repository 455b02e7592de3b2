// The readers of everything that comes from outside, each with a good sample: what the fuzzer (fuzz_main.cpp) and the
// test of the corpus (corpus_test.cpp) run. A reader may refuse with InputError and nothing else. Samples are made in
// code; tests/fuzz/corpus/<reader>/ keeps some of them and what was found.
#pragma once

#include <ostream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace duet::fuzz {

struct Reader {
  const char* name;
  std::string (*sample)(unsigned seed);  // of several where the seed is not ignored
  void (*read)(std::string_view bytes);
};

inline void PrintTo(const Reader& reader, std::ostream* out) { *out << reader.name; }  // for GoogleTest

std::vector<Reader> core_readers();
std::vector<Reader> motion_readers();
std::vector<Reader> body_readers();
std::vector<Reader> format_readers();
std::vector<Reader> robot_readers();
std::vector<Reader> network_readers();
std::vector<Reader> controller_readers();
std::vector<Reader> policy_readers();
std::vector<Reader> result_readers();
std::vector<Reader> dataset_readers();
std::vector<Reader> bench_readers();
std::vector<Reader> training_readers();
std::vector<Reader> guard_readers();
std::vector<Reader> hardware_readers();

std::vector<Reader> all_readers();

// Writes `bytes` to a file of this process and gives its path: for readers that open their file themselves.
std::string scratch_file(const std::string& name, std::string_view bytes);
std::string scratch_folder();

// The separator of a reader's parts where its bytes stand for several files.
inline constexpr std::string_view kSeparator = "\n====\n";
// The parts; as many as asked for, the last ones empty where there are fewer.
std::vector<std::string_view> parts(std::string_view bytes, std::size_t count);

}  // namespace duet::fuzz
