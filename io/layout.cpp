#include "duet/io/layout.h"

#include <fmt/format.h>

namespace duet {
namespace {

std::string entry_text(const LayoutEntry& entry, int first) {
  if (entry.size == 1) return fmt::format("{} {}", entry.name, first);
  return fmt::format("{} {}..{}", entry.name, first, first + entry.size - 1);
}

std::string block_text(const LayoutBlock& block, int first) {
  std::string text;
  for (const LayoutEntry& entry : block.entries) {
    if (!text.empty()) text += ", ";
    text += entry_text(entry, first);
    first += entry.size;
  }
  if (block.frames > 1) text += fmt::format(" ({} frames of {})", block.frames, block.frame_size());
  return text;
}

}  // namespace

int LayoutBlock::frame_size() const {
  int size = 0;
  for (const LayoutEntry& entry : entries) size += entry.size;
  return size;
}

int layout_size(const std::vector<LayoutBlock>& blocks) {
  int size = 0;
  for (const LayoutBlock& block : blocks) size += block.frames * block.frame_size();
  return size;
}

std::string layout_text(const std::vector<LayoutBlock>& blocks) {
  std::string text;
  int first = 0;
  for (const LayoutBlock& block : blocks) {
    if (!text.empty()) text += "; ";
    text += block_text(block, first);
    first += block.frames * block.frame_size();
  }
  return text;
}

}  // namespace duet
