// The origin of a run's rows: the SHA-256 of everything that rows of one table must agree on, and of each policy and
// controller that made some of them. Contents count, not the places where files lie, and nothing of what this machine
// has installed.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "duet/core/digest.h"
#include "duet/experiment/suite/suite.h"

namespace duet {

// A file of a policy or a controller with what is in it.
struct HashedFile {
  std::string role, path, sha256;  // role as in LoadedFile
};

// The identity of one of a suite's policies or controllers, but for its name.
struct ActorIdentity {
  std::string digest;  // over what is used, options, prompt and partner, and the contents of `files`; "" where one of
                       // them is not on this machine
  std::vector<HashedFile> files;
  std::string absence;  // why the digest is empty
};

// Throws as policy_files and controller_files for what is broken. `files`: digests of what was loaded already; those of
// files that are not in it are taken now, and added.
ActorIdentity identity_of(const SuitePolicy& policy, FileDigests& files);
ActorIdentity identity_of(const SuiteController& controller, FileDigests& files);
ActorIdentity identity_of(const SuitePolicy& policy);
ActorIdentity identity_of(const SuiteController& controller);

// SHA-256 of what the suite and its profile say: all but the list of policies, the list of engines, tags and the places
// of files. In the place of clips, limits, cards and descriptors stand their contents; the version of the detectors is
// in it. Policies, engines and what a controller loads are told by each row.
std::string suite_hash(const Suite& suite, FileDigests files = {});

struct RunIdentity {
  std::string suite_hash;
  std::map<std::string, std::string> policies{}, controllers{};  // name -> digest, "" where absent; the null arm's too
  FileDigests files{};                                           // of all that was digested
};

// `files`: of what was loaded for the run (Bodies::read). Throws InputError where one of them is another now.
RunIdentity identity_of(const Suite& suite, FileDigests files = {});

}  // namespace duet
