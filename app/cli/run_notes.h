// Runs as commands read them, and what has to be said of them beside every table: rows that were left out, episodes
// that are missing.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "duet/app/command.h"
#include "duet/report/ranking/ranking.h"
#include "duet/rows/folder/run_directory.h"

namespace duet::cli {

// load_run; its warnings go to standard error.
Run open_run(const std::string& path, RowExtent extent = RowExtent::kWhole);

// "runs/a: 76 of 400 episodes: partial": a line for each run that is not whole; the path where there are several.
std::vector<std::string> completeness_notes(const std::vector<std::string>& paths, const std::vector<Run>& runs);
// Which policies were slow, and which of the rows repeat others and count once; of that is warned, too.
void add_row_notes(const std::vector<EpisodeRow>& rows, std::vector<std::string>& notes);

// The same after the warning that the suite only bears the name of one that ships, where it does.
std::vector<std::string> with_suite(const RankingSuite& suite, std::vector<std::string> notes);

// A file's text with the notes, as its format has them (md, csv, tex, svg; json: before its own in the key "notes");
// unchanged without any.
std::string with_notes(const std::string& format, const std::string& text, const std::vector<std::string>& notes);

// Whether episodes ended without a result: errors, time-outs, unsupported ones. `outcomes`: how many of each.
bool has_faults(const std::map<std::string, int>& outcomes);
// Says on standard error that episodes timed out, and what runs them again.
void warn_of_timeouts(const std::map<std::string, int>& outcomes);

// Throws InputError for a run whose episodes are not all there, unless `allowed`; `action` is what is refused.
void require_whole(const Run& run, const std::string& path, bool allowed, const std::string& action);

}  // namespace duet::cli
