#include "duet/nn/torch_archive.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "duet/archives/zip/zip.h"
#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

constexpr ZipLimits kLimits{.entry_bytes = std::size_t{1} << 28, .total_bytes = std::size_t{1} << 29};

std::vector<float> floats(const TorchArchive& archive, const std::string& entry, const std::string& content) {
  if (content.size() % sizeof(float) != 0)
    archive.refuse(fmt::format("tensor '{}': expected 4 bytes a number, found {} bytes", entry, content.size()));
  std::vector<float> values(content.size() / sizeof(float));
  if (!values.empty()) std::memcpy(values.data(), content.data(), content.size());
  return values;
}

void take(TorchArchive& archive, const std::string& entry, const std::string& content) {
  if (entry == "data.pkl") archive.pickle = content;
  if (entry.starts_with("code/") && entry.ends_with(".py")) archive.sources[entry.substr(5)] = content;
  if (entry == "byteorder" && !content.starts_with("little")) archive.refuse("expected little-endian numbers");
  if (!entry.starts_with("data/")) return;
  const std::string number = entry.substr(5);
  if (number.empty() || number.size() > 4 || !std::ranges::all_of(number, [](char c) { return c >= '0' && c <= '9'; }))
    archive.refuse(fmt::format("expected tensors numbered from 0, found '{}'", entry));
  archive.tensors[std::stoi(number)] = floats(archive, entry, content);
}

}  // namespace

void TorchArchive::refuse(const std::string& problem) const {
  throw InputError(fmt::format("'{}': TorchScript: {}", file, shown(problem, kShownSentence)));
}

bool holds_torch_code(std::string_view bytes, const std::string& file) {
  bool found = false;
  const auto is_code = [&](const std::string& entry) {
    found = found || entry.find("/code/") != std::string::npos || entry.starts_with("code/");
    return false;  // the name is enough
  };
  read_zip(bytes, file, kLimits, is_code, [](const std::string&, const std::string&) {});
  return found;
}

const std::vector<float>& TorchArchive::finite(int number) const {
  const std::vector<float>& values = tensors.at(number);
  for (const float value : values)
    if (!std::isfinite(value))
      refuse(fmt::format("tensor 'data/{}': expected finite numbers, found {}", number, value));
  return values;
}

TorchArchive read_torch_archive(std::string_view bytes, const std::string& file) {
  TorchArchive archive{.file = file};
  read_zip(bytes, file, kLimits, [&](const std::string& entry, const std::string& content) {
    // "policy/data/0", "policy/data.pkl", "policy/code/..." : the first folder has any name.
    take(archive, entry.substr(std::min(entry.find('/') + 1, entry.size())), content);
  });
  if (archive.pickle.empty()) archive.refuse("expected an entry 'data.pkl', found none");
  return archive;
}

}  // namespace duet
