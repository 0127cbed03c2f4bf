#pragma once

#include "options.hpp"

namespace ringfence::tools {

/// Lists a journal, checks it, or writes the contacts of one of its frames. Returns the exit code. Throws Error if the
/// journal cannot be read.
int list_journal(const JournalListOptions& options);

}  // namespace ringfence::tools
