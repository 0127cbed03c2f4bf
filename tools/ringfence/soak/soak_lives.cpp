#include "soak/soak_lives.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <random>
#include <string>
#include <unordered_map>

#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "exit_code.hpp"
#include "job.hpp"
#include "ringfence/error.hpp"
#include "soak/soak_run.hpp"
#include "stop_signals.hpp"

namespace ringfence::tools {
namespace {

using Clock = std::chrono::steady_clock;

// From the first new frame of a process to its death.
constexpr double shortest_life_s = 0.5, longest_life_s = 20;
constexpr double longest_share = 1.0 / 6;  // of the whole time

/// What a process reports to its parent.
struct Record {
  enum class Kind : std::uint64_t {
    complete,  ///< a frame is complete, for the first time or again
    restored,  ///< the world stands after so many frames
  };
  Kind kind = Kind::complete;
  std::uint64_t frames = 0;
  std::uint64_t digest = 0;  ///< of these frames
};

double seconds_since(Clock::time_point time) { return std::chrono::duration<double>(Clock::now() - time).count(); }

/// The process that a soak runs in.
class Life {
 public:
  Life(const RunOptions& options, bool resumes, double minutes, std::uint64_t seed) {
    std::array<int, 2> ends{};
    if (pipe(ends.data()) != 0) throw Error(fmt::format("--soak: no pipe: {}", std::strerror(errno)));
    std::fflush(nullptr);
    process_ = fork();
    if (process_ < 0) throw Error(fmt::format("--soak: no process: {}", std::strerror(errno)));
    if (process_ == 0) {
      close(ends[0]);
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      setpgid(0, 0);  // a key on the terminal ends the parent, which ends this process in order
      live(options, resumes, minutes, seed, ends[1]);
    }
    close(ends[1]);
    pipe_ = ends[0];
  }
  ~Life() {
    if (process_ > 0) {
      ::kill(process_, SIGKILL);
      wait();
    }
    close(pipe_);
  }
  Life(const Life&) = delete;
  Life& operator=(const Life&) = delete;

  void kill(int signal) const { ::kill(process_, signal); }
  /// Waits up to 50 ms for a record. False at the end of the process.
  bool read(Record& record, bool& has_record) {
    has_record = false;
    pollfd waits{pipe_, POLLIN, 0};
    if (poll(&waits, 1, 50) <= 0) return true;
    const ssize_t size = ::read(pipe_, &record, sizeof record);  // records are written at once, so they are whole
    if (size < 0 && errno == EINTR) return true;
    has_record = size == sizeof record;
    return has_record;
  }
  /// How the process ended, as waitpid says.
  int wait() {
    int status = 0;
    while (waitpid(process_, &status, 0) < 0 && errno == EINTR) {
    }
    process_ = 0;
    return status;
  }

 private:
  /// The rest of the new process.
  [[noreturn]] static void live(RunOptions options, bool resumes, double minutes, std::uint64_t seed, int pipe) {
    options.journal.resumes = resumes;
    options.output.quiet = true;
    const auto report = [pipe](Record::Kind kind) {
      return [pipe, kind](std::uint64_t frames, std::uint64_t digest) {
        const Record record{kind, frames, digest};
        if (write(pipe, &record, sizeof record) != sizeof record) _exit(incomplete);
      };
    };
    int code = usage_error;
    try {
      code = run_soak(make_job(options), minutes, seed, report(Record::Kind::complete), report(Record::Kind::restored));
    } catch (const IncompleteError& error) {
      fmt::print(stderr, "ringfence: {}\n", error.what());
      code = incomplete;
    } catch (const std::exception& error) {
      fmt::print(stderr, "ringfence: {}\n", error.what());
    }
    std::fflush(nullptr);
    _exit(code);
  }

  pid_t process_ = 0;
  int pipe_ = -1;
};

/// What the processes said together.
class Witness {
 public:
  explicit Witness(bool is_durable) : is_durable_(is_durable) {}

  void begin_life() { is_restored_ = false; }
  bool is_restored() const noexcept { return is_restored_; }
  void take(const Record& record) {
    if (record.kind == Record::Kind::restored) return take_restored(record.frames);
    const auto [known, is_new] = digests_.try_emplace(record.frames, record.digest);
    if (!is_restored_) ++again_;
    if (!is_new && known->second != record.digest && different_++ < 10) {
      fmt::print(stderr, "ringfence: frame {}: digest {:016x} when run again; it was {:016x}\n", record.frames,
                 record.digest, known->second);
    }
    if (is_restored_) complete_ = std::max(complete_, record.frames);
  }
  bool passed() const noexcept { return different_ == 0 && (missing_ == 0 || !is_durable_); }
  std::string text() const {
    return fmt::format("{} frames complete, {} run again, {} missing, {} with another digest", complete_, again_,
                       missing_, different_);
  }

 private:
  void take_restored(std::uint64_t frames) {
    is_restored_ = true;
    if (frames >= complete_) return;
    fmt::print(stderr, "ringfence: frames {} to {} were complete and are not in the journal\n", frames, complete_ - 1);
    missing_ += complete_ - frames;
    // The frames after it are other ones now.
    std::erase_if(digests_, [&](const auto& each) { return each.first > frames; });
    complete_ = frames;
  }

  bool is_durable_, is_restored_ = false;
  std::unordered_map<std::uint64_t, std::uint64_t> digests_;  ///< by number of frames
  std::uint64_t complete_ = 0, again_ = 0, missing_ = 0, different_ = 0;
};

/// One process after another.
class Lives {
 public:
  explicit Lives(const RunOptions& options)
      : options_(options),
        seconds_(options.soak_minutes * 60),
        random_(options.world.seed),
        witness_(options.journal.sync == JournalSync::always) {}

  int run() {
    int code = done;
    for (bool is_last = false; !is_last && code == done && witness_.passed();) {
      const double left_s = std::max(0.1, seconds_ - seconds_since(begin_)), life_s = draw_life();
      is_last = life_s >= left_s;
      Life life(options_, lives_ > 0, left_s / 60, options_.world.seed + lives_);
      ++lives_;
      const bool is_killed = watch(life, life_s, is_last);
      code = code_of(life.wait(), is_killed, is_last);
    }
    fmt::print("lives       {} processes, {} of them killed; {}\n", lives_, killed_, witness_.text());
    return witness_.passed() ? code : check_failed;
  }

 private:
  double draw_life() {
    const double longest = std::max(2 * shortest_life_s, std::min(longest_life_s, seconds_ * longest_share));
    return std::uniform_real_distribution<double>(shortest_life_s, longest)(random_);
  }

  /// Reads what a process reports, until its end. Kills it after `life_s` unless it is the last. Returns whether it
  /// did.
  bool watch(Life& life, double life_s, bool& is_last) {
    witness_.begin_life();
    Clock::time_point restored{};
    bool is_killed = false, is_stopped = false, has_record = false;
    Record record;
    while (life.read(record, has_record)) {
      const bool was_restored = witness_.is_restored();
      if (has_record) witness_.take(record);
      if (witness_.is_restored() && !was_restored) restored = Clock::now();
      if (stop_.received() && !is_stopped) {
        is_stopped = is_last = true;
        life.kill(SIGTERM);
      }
      if (!is_last && !is_killed && witness_.is_restored() && seconds_since(restored) > life_s) {
        is_killed = true;
        life.kill(SIGKILL);
      }
    }
    return is_killed;
  }

  /// `status`: as waitpid says.
  int code_of(int status, bool is_killed, bool& is_last) {
    if (is_killed && WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) {
      ++killed_;
      return done;
    }
    is_last = true;
    if (WIFEXITED(status)) return WEXITSTATUS(status);
    fmt::print(stderr, "ringfence: --soak: the process was ended by signal {}\n", WTERMSIG(status));
    return check_failed;
  }

  const RunOptions& options_;
  double seconds_;
  std::mt19937_64 random_;
  Witness witness_;
  StopSignals stop_;
  Clock::time_point begin_ = Clock::now();
  std::uint64_t lives_ = 0, killed_ = 0;
};

}  // namespace

int run_soak_lives(const RunOptions& options) { return Lives(options).run(); }

}  // namespace ringfence::tools
