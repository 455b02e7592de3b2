// Which digest a name in rows stands for. Rows that say "dstar" and were made by two networks are of two policies: they
// are never in one table, one run or one merge.
#pragma once

#include <map>
#include <string>
#include <utility>

#include "duet/rows/episode_row.h"
#include "duet/rows/folder/run_info.h"

namespace duet {

class NameDigests {
 public:
  // `kind`: "policy"; `where`: for messages. Throws InputError where the name stands for another digest already: both,
  // and where each was found. An empty digest is one too: of a policy whose files are not there.
  void add(const std::string& kind, const std::string& name, const std::string& digest, const std::string& where);
  // Policy, controller and, of an episode that ran in an engine, the engine with its resolved profile.
  void add(const EpisodeRow& row, const std::string& where);
  // Adds the policies and controllers of a run.json; one that was absent then may have come since.
  void add(const RunInfo& info, const std::string& where);

 private:
  struct Place {
    std::string digest, where;
  };
  std::map<std::pair<std::string, std::string>, Place> places_;  // by kind and name
};

// "12ab34cd56ef", "absent" for an empty one.
std::string short_digest(const std::string& digest);

}  // namespace duet
