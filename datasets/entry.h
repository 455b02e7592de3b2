// The record of a clip of a data set, kept or not: its origin, why it was refused, what was made of it. One line
// of JSON in the data set's log; the tables and the card are made of nothing else.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/metrics/clip_statistics.h"

namespace duet {

enum class ClipStatus {
  kKept,
  kRejected,  // a gate refused it
  kOther,     // its label is none of duet's tasks
  kFailed     // it could not be read or retargeted
};
std::string_view to_string(ClipStatus status);  // "kept", "rejected", "other task", "failed"

struct NamedDigest {
  std::string file;    // of a source: its name without folders; of what was made: relative to the data set
  std::string sha256;  // 64 hex digits
  bool operator==(const NamedDigest&) const = default;
};

struct DatasetEntry {
  std::string clip = {};  // its id in the data set
  std::string key = {};   // digest of the source files and of all options: the same key is the same work
  ClipStatus status = ClipStatus::kFailed;
  std::vector<std::string> gates = {};    // that refused it
  std::vector<std::string> reasons = {};  // one sentence each
  std::string format = {}, licence = {}, label = {};
  std::vector<NamedDigest> sources = {};
  std::vector<std::string> evidence = {};  // what was found of unit, axes, rate, floor, ...
  std::map<std::string, std::string> provenance = {};
  std::string task = {}, reactor = {};
  int frames = 0;                               // at 50 Hz
  double act_begin = 0.0, act_end = 0.0;        // [s]
  ClipStatistics statistics = {};               // zero seconds: none were made
  std::map<std::string, double> criteria = {};  // of the gates
  std::vector<NamedDigest> outputs = {};
  std::map<std::string, std::map<std::string, double>> metrics = {};  // robot -> figure -> value
};

// One line without a newline, and back. Throws InputError naming `name` and the fault.
std::string entry_line(const DatasetEntry& entry);
DatasetEntry parse_entry(std::string_view line, const std::string& name);

}  // namespace duet
