/// \file
/// Which items hang together: a forest in which every item points to another one of its set.

#ifndef ATOM_CORE_CPP_DISJOINT_SETS_H_
#define ATOM_CORE_CPP_DISJOINT_SETS_H_

#include <vector>

namespace atom_core {

/// The item that stands for the set of item i. The way there is shortened for the next time.
inline int FindRoot(std::vector<int>* parent, int i) {
  while ((*parent)[i] != i) i = (*parent)[i] = (*parent)[(*parent)[i]];
  return i;
}

/// Makes one set of those of items i and k.
inline void Unite(std::vector<int>* parent, int i, int k) {
  const int root = FindRoot(parent, k);
  (*parent)[FindRoot(parent, i)] = root;
}

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_DISJOINT_SETS_H_
