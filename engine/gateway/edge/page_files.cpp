#include "gateway/edge/page_files.hpp"

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <utility>

#include "ringfence/error.hpp"

namespace ringfence::gateway {
namespace {

constexpr std::size_t max_bytes = std::size_t{64} << 20;

std::string type_of(const std::filesystem::path& path) {
  constexpr std::array<std::pair<std::string_view, const char*>, 11> types{
      {{".html", "text/html; charset=utf-8"},
       {".js", "text/javascript; charset=utf-8"},
       {".css", "text/css; charset=utf-8"},
       {".json", "application/json"},
       {".map", "application/json"},
       {".svg", "image/svg+xml"},
       {".png", "image/png"},
       {".ico", "image/x-icon"},
       {".woff2", "font/woff2"},
       {".txt", "text/plain; charset=utf-8"},
       {".webmanifest", "application/manifest+json"}}};
  const std::string extension = path.extension().string();
  for (const auto& [known, type] : types) {
    if (extension == known) return type;
  }
  return "application/octet-stream";
}

std::string tag_of(const std::string& body) {
  std::array<char, 32> text{};
  const int size = std::snprintf(text.data(), text.size(), "\"%zx-%zx\"", body.size(), std::hash<std::string>()(body));
  return {text.data(), static_cast<std::size_t>(size)};
}

}  // namespace

PageFiles::PageFiles(const std::string& directory) {
  if (directory.empty()) return;
  std::size_t total = 0;
  try {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(directory)) {
      if (!entry.is_regular_file()) continue;
      std::ifstream stream(entry.path(), std::ios::binary);
      std::string body{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
      if (!stream) throw Error("the page's file " + entry.path().string() + " cannot be read");
      total += body.size();
      if (total > max_bytes) throw Error("the page's directory " + directory + " has more than 64 MB");
      const std::string tag = tag_of(body);
      const std::string path = "/" + std::filesystem::relative(entry.path(), directory).generic_string();
      files_.emplace(path, File{type_of(entry.path()), std::move(body), tag});
    }
  } catch (const std::filesystem::filesystem_error& error) {
    throw Error("the page's directory " + directory + " cannot be read: " + error.code().message());
  }
}

const PageFiles::File* PageFiles::find(std::string_view path) const noexcept {
  const auto found = files_.find(path == "/" ? std::string_view("/index.html") : path);
  return found == files_.end() ? nullptr : &found->second;
}

}  // namespace ringfence::gateway
