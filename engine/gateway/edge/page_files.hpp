#pragma once

#include <map>
#include <string>
#include <string_view>

namespace ringfence::gateway {

/// The files that the gateway serves, in memory: only what was in the directory at the start can be asked for.
class PageFiles {
 public:
  struct File {
    std::string type;  ///< Content-Type
    std::string body;
    std::string tag;  ///< ETag, changes with the contents
  };
  /// Reads all files of the directory and its folders; empty: none. Throws Error if it cannot be read or exceeds 64 MB.
  explicit PageFiles(const std::string& directory);

  /// The file for a path such as "/page.js"; "/" is "/index.html". Null if there is none.
  const File* find(std::string_view path) const noexcept;

 private:
  std::map<std::string, File, std::less<>> files_;
};

}  // namespace ringfence::gateway
