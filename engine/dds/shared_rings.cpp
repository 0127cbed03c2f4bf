#include "dds/shared_rings.hpp"

#include <cstring>
#include <new>
#include <utility>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ringfence::dds {
namespace {

/// The largest ring that a process opens.
constexpr std::size_t max_ring_bytes = std::size_t{1} << 24;
/// Without these the other process could take pages away, and reading them would end this process.
constexpr int seals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;

/// The start of the memory. Constant.
struct Head {
  static constexpr std::uint64_t expected_magic = 0x52464d454d303031;  ///< "RFMEM001"
  std::uint64_t magic = expected_magic;
  std::uint64_t first_bytes = 0;   ///< of the ring that the creator writes; it is behind the control block
  std::uint64_t second_bytes = 0;  ///< of the ring that the other process writes; it is behind the first one
};

/// The control block: whole pages.
struct Control {
  Head head;
  alignas(link::cache_line_pair_bytes) link::StreamControl<link::ProcessAtomics> stream;
};

std::size_t page_bytes() noexcept { return static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)); }

std::size_t control_bytes() noexcept { return (sizeof(Control) + page_bytes() - 1) / page_bytes() * page_bytes(); }

bool is_ring_size(std::uint64_t bytes) noexcept {
  return bytes >= page_bytes() && bytes <= max_ring_bytes && (bytes & (bytes - 1)) == 0;
}

/// Maps a part of the memory in the place of reserved addresses.
bool map_part(int descriptor, std::byte* at, std::size_t bytes, std::size_t offset) noexcept {
  return ::mmap(at, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_FIXED | MAP_POPULATE, descriptor,
                static_cast<off_t>(offset)) != MAP_FAILED;
}

}  // namespace

// The order in the file: control block, ring of the creator, ring of the other process. The order in the addresses:
// control block, each ring of the file twice.
std::byte* SharedRings::map(int descriptor, const Layout& layout) noexcept {
  const std::size_t first = layout.side == 0 ? layout.out_bytes : layout.in_bytes;
  const std::size_t second = layout.side == 0 ? layout.in_bytes : layout.out_bytes;
  void* const reserved = ::mmap(nullptr, layout.mapped(), PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (reserved == MAP_FAILED) {
    return nullptr;
  }
  auto* const memory = static_cast<std::byte*>(reserved);
  const std::size_t control = layout.control_bytes;
  std::byte* const rings = memory + control;
  if (map_part(descriptor, memory, control, 0) && map_part(descriptor, rings, first, control) &&
      map_part(descriptor, rings + first, first, control) &&
      map_part(descriptor, rings + 2 * first, second, control + first) &&
      map_part(descriptor, rings + 2 * first + second, second, control + first)) {
    return memory;
  }
  ::munmap(reserved, layout.mapped());
  return nullptr;
}

SharedRings::SharedRings(int descriptor, const Layout& layout, std::byte* memory) noexcept
    : descriptor_(descriptor),
      layout_(layout),
      memory_(memory),
      out_(memory + layout.control_bytes + (layout.side == 0 ? 0 : 2 * layout.in_bytes)),
      in_(memory + layout.control_bytes + (layout.side == 0 ? 2 * layout.out_bytes : 0)),
      end_(reinterpret_cast<Control*>(memory)->stream, layout.side, layout.out_bytes, layout.in_bytes) {}

SharedRings::~SharedRings() {
  close_descriptor();
  ::munmap(memory_, layout_.mapped());
}

void SharedRings::close_descriptor() noexcept {
  if (descriptor_ >= 0) {
    ::close(std::exchange(descriptor_, -1));
  }
}

std::unique_ptr<SharedRings> SharedRings::create(std::size_t out_bytes, std::size_t in_bytes) noexcept {
  const Layout layout{0, control_bytes(), out_bytes, in_bytes};
  if (!is_ring_size(out_bytes) || !is_ring_size(in_bytes)) {
    return nullptr;
  }
  const int descriptor = ::memfd_create("ringfence-link", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (descriptor < 0) {
    return nullptr;
  }
  const auto size = static_cast<off_t>(layout.control_bytes + out_bytes + in_bytes);
  std::byte* memory = nullptr;
  if (::ftruncate(descriptor, size) == 0 && ::fcntl(descriptor, F_ADD_SEALS, seals) == 0 &&
      ::fallocate(descriptor, 0, 0, size) == 0) {
    memory = map(descriptor, layout);
  }
  if (memory == nullptr) {
    ::close(descriptor);
    return nullptr;
  }
  new (memory) Control{{.first_bytes = out_bytes, .second_bytes = in_bytes}, {}};
  return std::unique_ptr<SharedRings>(new (std::nothrow) SharedRings(descriptor, layout, memory));
}

std::unique_ptr<SharedRings> SharedRings::open(int descriptor) noexcept {
  Head head;
  struct stat file {};
  const int sealed = descriptor < 0 ? -1 : ::fcntl(descriptor, F_GET_SEALS);
  const bool is_readable = sealed >= 0 && (sealed & F_SEAL_SHRINK) != 0 && ::fstat(descriptor, &file) == 0 &&
                           ::pread(descriptor, &head, sizeof head, 0) == sizeof head;
  if (!is_readable || head.magic != Head::expected_magic || !is_ring_size(head.first_bytes) ||
      !is_ring_size(head.second_bytes)) {
    return nullptr;
  }
  const Layout layout{1, control_bytes(), head.second_bytes, head.first_bytes};
  if (static_cast<std::uint64_t>(file.st_size) != layout.control_bytes + layout.out_bytes + layout.in_bytes) {
    return nullptr;
  }
  std::byte* const memory = map(descriptor, layout);
  if (memory == nullptr) {
    return nullptr;
  }
  return std::unique_ptr<SharedRings>(new (std::nothrow) SharedRings(-1, layout, memory));
}

}  // namespace ringfence::dds
