// Names that people type: the nearest known one, and the sentence that refuses an unknown one. Thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/core/require.h"

namespace duet {

// The candidate with the smallest Damerau-Levenshtein distance (ignoring case, and '-' equal to '_'), or "" where none
// is within a third of the name's length (at least 2).
std::string closest_name(std::string_view name, std::span<const std::string> candidates);

// "unknown task 'hugg': did you mean 'hug'? Known: hug, handshake, ..." (the question only where there is a near name).
std::string unknown_name_message(std::string_view kind, std::string_view name, std::span<const std::string> candidates);

// The value of an option that is given by name, `fallback` where it is not.
std::string option_or(const std::map<std::string, std::string>& options, const std::string& name,
                      const std::string& fallback = "");

// Throws std::invalid_argument where one of the options set of `kind` `name` is not `known`: "controller 'pd': expected
// no option, found 'x'", or the sentence above.
void check_options(std::string_view kind, std::string_view name, const std::map<std::string, std::string>& options,
                   std::span<const std::string> known);

// Names that stand in tables, keys and file names: letters, digits and _ . + - only, and none of + and - first: options
// of a command line and formulas of a spreadsheet begin so.

bool is_plain_letter(char letter);
bool is_plain_name(std::string_view name);
std::string plain_name_message(std::string_view name);  // the sentence for one that is not

// The ids of clips: of those that are synthesised, and what is added to an id for another view or role of its clip.

// "people-handshake-s42-0007"; `manner`: "synth", "people" or "varied".
std::string synthetic_clip_id(std::string_view manner, std::string_view task, std::uint64_t seed, int index);

// The id of the clip as a depth camera sees it.
std::string tracked_clip_id(const std::string& id);

// The id of the clip in which the robot replaces the other person than before, who was 'A' or 'B': with "-A" or "-B" at
// its end, and back the first one.
std::string id_in_other_role(const std::string& id, char before);

// Words of commands that people or schedulers give to a shell: hints with the name of a folder, scripts of Slurm.

// `text` as one word of a POSIX shell: in single quotes where it has anything but letters, digits and _./:=,+-@%.
std::string shell_word(std::string_view text);
// Words with a space between them.
std::string shell_words(const std::vector<std::string>& words);

// Entries that a program adds by name to those that duet has: controllers, policies, metrics of its own. Thread-safe;
// an entry stays for as long as the program runs, at one address.

// `Entry` has a `name`.
template <typename Entry>
class OpenRegistry {
 public:
  // Throws std::invalid_argument for a name that is empty, ends in ".yaml" (a descriptor's), or is there already, here
  // or in `shipped`; `kind` ("controller") is what messages call it.
  void add(std::string_view kind, Entry entry, const std::vector<std::string>& shipped) {
    const std::string name(entry.name), called = std::string(kind) + " '" + name + "'";
    require(!name.empty(), std::string(kind) + ": expected a name, found none");
    require(!name.ends_with(".yaml"), called + ": a name that ends in .yaml is the path of a descriptor");
    const std::lock_guard lock(mutex_);
    const bool taken = std::find(shipped.begin(), shipped.end(), name) != shipped.end() || find_locked(name) != nullptr;
    require(!taken, called + " is there already: choose another name");
    entries_.push_back(std::move(entry));
  }

  // Null where there is none.
  [[nodiscard]] const Entry* find(std::string_view name) const {
    const std::lock_guard lock(mutex_);
    return find_locked(name);
  }

  // In the order in which they were added.
  [[nodiscard]] std::vector<const Entry*> all() const {
    const std::lock_guard lock(mutex_);
    std::vector<const Entry*> entries;
    for (const Entry& entry : entries_) entries.push_back(&entry);
    return entries;
  }

 private:
  const Entry* find_locked(std::string_view name) const {
    for (const Entry& entry : entries_)
      if (entry.name == name) return &entry;
    return nullptr;
  }

  mutable std::mutex mutex_;
  std::deque<Entry> entries_;
};

}  // namespace duet
