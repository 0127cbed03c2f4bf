#pragma once

#include <cerrno>
#include <csignal>
#include <fstream>
#include <string>
#include <vector>

#include <fcntl.h>
#include <sched.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace ringfence::test {

/// A run of the program that the test can signal. Standard output is a pipe, so that the program waits until the
/// test reads it; standard error goes to a file.
class RunningProgram {
 public:
  RunningProgram(std::vector<std::string> arguments, const std::string& error_file) {
    arguments.insert(arguments.begin(), "ringfence");
    std::vector<char*> words;
    for (std::string& argument : arguments) words.push_back(argument.data());
    words.push_back(nullptr);
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) return;
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, error_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    if (posix_spawn(&process_, RINGFENCE_PROGRAM, &actions, nullptr, words.data(), environ) != 0) process_ = -1;
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    output_ = ends[0];
  }
  ~RunningProgram() {
    if (process_ > 0 && !ended_) {
      kill(process_, SIGKILL);
      wait();
    }
    if (output_ >= 0) close(output_);
  }
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  bool started() const { return process_ > 0; }
  void signal(int number) const { kill(process_, number); }

  /// Waits until the program handles `number` itself. False if it ended before.
  bool wait_until_caught(int number) const {
    for (;;) {
      std::ifstream status("/proc/" + std::to_string(process_) + "/status");
      std::string field, value;
      bool zombie = !status;
      while (status >> field) {
        if (field == "State:" && status >> value) zombie = value == "Z";
        if (field == "SigCgt:" && status >> value && (std::stoull(value, nullptr, 16) >> (number - 1) & 1) != 0)
          return true;
      }
      if (zombie) return false;
      sched_yield();
    }
  }

  /// Waits for standard output and returns a part of it; empty at its end.
  std::string read_some() const {
    std::string text(4096, '\0');
    ssize_t got = 0;
    do got = read(output_, text.data(), text.size());
    while (got < 0 && errno == EINTR);
    text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    return text;
  }
  std::string read_all() const {
    std::string text;
    for (std::string part = read_some(); !part.empty(); part = read_some()) text += part;
    return text;
  }

  /// Waits for the end and returns the exit code, or minus the number of the signal that ended the program.
  int wait() {
    int status = 0;
    while (waitpid(process_, &status, 0) < 0 && errno == EINTR) {
    }
    ended_ = true;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

 private:
  pid_t process_ = -1;
  int output_ = -1;
  bool ended_ = false;
};

}  // namespace ringfence::test
