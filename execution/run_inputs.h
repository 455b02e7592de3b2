// Inputs of a run, kept with it, so that it can be repeated where the originals are not: `inputs/` of a run
// directory holds copies of clips, descriptors with the programs beside them, limits and cards, and inputs.json with
// the SHA-256 of each and of the networks. Networks stay where they are and are found again by what is in them.
#pragma once

#include <string>
#include <vector>

#include "duet/experiment/plan/run_identity.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

struct RunInput {
  std::string of;    // "clips", "contact_limits", "robot", "policy mine", "controller twist2"
  std::string role;  // of a policy's or controller's file as in LoadedFile; else empty
  std::string file;  // from the run directory where it is kept there; else the name of the file
  std::string sha256;
  bool kept = false;
};

// A suite whose files lie in a run directory, and how they come there.
struct ArchivedSuite {
  struct Copy {
    std::string from, to;  // to: from the run directory
    std::string sha256;    // of what is used
  };
  Suite suite;  // its paths start at the run directory
  std::vector<Copy> copies;
  std::vector<RunInput> inputs;
};

// Plans what `folder` is to keep of a suite. Clips of more than kMostClipBytes in all stay where they are. Writes
// nothing; throws InputError for a file that cannot be read. `files`: digests of what is loaded (RunIdentity::files).
inline constexpr std::uintmax_t kMostClipBytes = std::uintmax_t{1} << 28;
ArchivedSuite archive_inputs(Suite suite, const std::string& folder, const FileDigests& files = {});

// Copies what is not in `folder` yet and writes inputs.json, in this order. Throws InputError for a file that is
// another one by now than the run has loaded.
void keep_inputs(const ArchivedSuite& kept, const std::string& folder);
// Whether it has done so to its end.
bool has_inputs(const std::string& folder);

// The inputs in a run's inputs.json. Throws InputError (file, key, expected, found).
std::vector<RunInput> read_inputs(const std::string& folder);

// A suite whose paths below `from` start there, all others at `to`: what a suite.yaml in `to` says of inputs that are
// copied there from the run directory `from`.
Suite rebased(Suite suite, const std::string& from, const std::string& to);

// Places to look for what a run does not keep, and names that need not be looked for.
struct InputPlaces {
  std::vector<std::string> skipped_policies = {}, skipped_controllers = {};
  std::string clips = {};  // a folder or one file; empty: nobody gave one
};

// The suite of a run: from its suite.yaml, each network where it is found. Looked at are the place that the suite names
// or duet's own, the run directory, what ships with duet and $DUET_MODELS. Clips that the run does not keep are looked
// for where the suite names them, and by what is in them among the files below `clips`. Throws InputError for a file
// that is not what it was when the run was made, MissingError for one that is not there: which, the SHA-256 expected
// and found. Policies and controllers in `skipped` are not looked at.
Suite suite_of_run(const Run& run, const InputPlaces& places = {});

// The suite of a run without a look at its networks: what tables and pages need. Throws InputError for a file that the
// run keeps and suite.yaml names elsewhere: a run that came from others has no say over what is read in its place.
Suite suite_of_head(const Run& run);

// Why the clips of a suite_of_head, these files, cannot be shown, as the end of a sentence: one is not there, or is not
// what the run was made from. Empty where they can.
std::string clips_fault(const Run& run, const std::vector<std::string>& clips);

// The kept files of a run that are published: those of its index and no others. `without_clips`: but for the
// clips, of which the index then has the SHA-256 alone. Throws InputError for a file that is not what the index says.
// Nothing of a run that has no index.
PublishedInputs published_inputs(const std::string& run, bool without_clips);

}  // namespace duet
