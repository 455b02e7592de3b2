// Import of a controller: an IO descriptor written from what the makers of a network say of it, in the metadata of its
// ONNX file (holosoma, BeyondMimic, mjlab) or in a deployment's YAML (unitree_rl_lab's and mjlab's deploy.yaml,
// rl_sar's config.yaml, unitree_rl_gym's). Nothing is guessed in silence: what the file does not say is a sentence.
#pragma once

#include <string>
#include <vector>

namespace duet {

struct ImportRequest {
  std::string file;
  std::string network{};  // "": the file itself, or the one that a YAML file names or has beside it
  std::string robot{};    // card by name or path; "": the one that has the network's joints
  std::string name{};     // of the controller; "": made of the file's
  std::string history{};  // "frames" or "terms": which of the two a history is, where the file does not say
  std::string folder{};   // in which the descriptor will stand; "": the network's
};

struct ImportedDescriptor {
  std::string kind;                  // of the file: "holosoma", "BeyondMimic or mjlab", ...
  std::string name, robot, network;  // of the controller; its card; path of the network, "" where there is none
  std::string text;                  // the descriptor, YAML with comments
  std::vector<std::string> assumed;  // what the file does not say, a sentence each
  std::vector<std::string> found;    // what the network does with it, a sentence each
};

// Throws InputError: a file that is none of these (a checkpoint, a Git LFS pointer, a page, a network without
// metadata), a term or a joint that is unknown, a network of other sizes than the file says; MissingError for a network
// that is not there.
ImportedDescriptor import_descriptor(const ImportRequest& request);

}  // namespace duet
