/// \file
/// What holds for every table of the panel.

#ifndef ATOM_RVIZ_PLUGINS_TESTS_TABLE_LAWS_H_
#define ATOM_RVIZ_PLUGINS_TESTS_TABLE_LAWS_H_

#include <gtest/gtest.h>

#include "logic/tables.h"

namespace atom_rviz {

/// Every row has a cell for each column.
inline void expect_rectangular(const Table& table) {
  for (const Row& row : table.rows) EXPECT_EQ(row.cells.size(), table.header.size()) << row.key;
}

}  // namespace atom_rviz

#endif  // ATOM_RVIZ_PLUGINS_TESTS_TABLE_LAWS_H_
