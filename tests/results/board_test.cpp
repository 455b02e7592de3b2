#include "duet/results/analyses/board.h"

#include <gmock/gmock.h>

#include "duet/results/report/report_parts.h"

namespace duet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Board with_contacts(long over) {
  BoardRow row;
  row.controller = "wbc_sim";
  row.policy = "dstar";
  row.perturbation = "clean";
  row.rates.resize(1);
  row.rates[0].engine = "mujoco";
  row.contact = BoardContact{.episodes = 5, .touched = 4, .over = over, .worst_ratio = 0.5};
  Board board;
  board.rows = {row};
  board.engines = 1;
  return board;
}

TEST(BoardHtml, OnlyTouchesOverALimitAreMarked) {
  EXPECT_THAT(board_html(with_contacts(0)), Not(HasSubstr("class=\"over\"")));
  EXPECT_THAT(board_html(with_contacts(1)), HasSubstr("<td data-v=\"1\" class=\"over\">1 of 4"));
}

}  // namespace
}  // namespace duet
