// Generates the gnuplot script of `ringfence scale --plots`.
#include <algorithm>
#include <iterator>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "plots.hpp"

namespace ringfence::tools {
namespace {

constexpr const char* titles[] = {"user domain deployment", "user/server domain deployment",
                                  "user/collision domain deployment"};
constexpr const char* separator = ", \\\n  ";

const char* colour(std::size_t i) {
  constexpr const char* colours[] = {"#1b6ca8", "#d1495b", "#2e933c", "#8e5ea2", "#e08e00", "#4d4d4d", "#00a6a6"};
  return colours[i % std::size(colours)];
}

/// `text` as a gnuplot string. Within single quotes gnuplot reads '' as '.
std::string quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("''") : std::string(1, c);
  return quoted + "'";
}

std::string nodes_word(std::uint32_t nodes) { return nodes == 1 ? "1 node" : fmt::format("{} nodes", nodes); }

/// A plot element that draws the data block `data` as points and lines. Without a title it has no entry in the key.
std::string line(const std::string& data, const char* style, std::size_t colour_index, const std::string& title,
                 const char* columns = "1:2") {
  return fmt::format("{} using {} with linespoints {} lc rgb '{}' {}", data, columns, style, colour(colour_index),
                     title.empty() ? "notitle" : "title " + quoted(title));
}
constexpr const char* solid = "lw 2 pt 7 ps 0.7";
constexpr const char* dashed = "lw 2 dt 4 pt 5 ps 0.7";
constexpr const char* hollow = "lw 1.2 dt 2 pt 6 ps 0.9";

std::string joined(const std::vector<std::string>& parts, const char* between) {
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : between) + part;
  return text;
}

/// Generates the script, plot by plot.
class Script {
 public:
  Script(std::string prefix, const ScaleResult& result) : prefix_(std::move(prefix)), result_(result) {
    for (const ScaleRow& row : result.rows) {
      objects_.insert(row.objects);
      if (row.nodes > 0) nodes_.insert(row.nodes);
      deployments_.insert(row.deployment);
      placements_.insert(row.placement);
    }
  }

  std::string write() {
    text_ =
        "# Drawn by `ringfence scale --plots`; run it through gnuplot to draw again.\n"
        "set encoding utf8\nset grid lc rgb '#cccccc'\nset border lc rgb '#444444'\nset tics nomirror\n"
        "set key Left reverse samplen 2.5\n";
    if (objects_.size() > 1) {
      for (const Placement placement : placements_) {
        for (const Deployment deployment : deployments_) frame_graph(deployment, placement);
      }
      contacts_graph();
    }
    for (const Placement placement : placements_) {
      path_graph(placement);
      speedup_graph(placement);
    }
    for (const ClusterResult& cluster : result_.clusters) cluster_graph(cluster);
    return text_;
  }

 private:
  /// Adds a data block with one line for each element of `range` for which `format` returns text. Returns the name of
  /// the block. It begins with an undefined point, because gnuplot refuses empty blocks.
  template <class Range, class Format>
  std::string block(const Range& range, Format format) {
    std::string name = fmt::format("$d{}", ++blocks_);
    text_ += name + " << EOD\n1 NaN NaN \"\"\n";
    for (const auto& each : range) {
      if (const std::string entry = format(each); !entry.empty()) text_ += entry + '\n';
    }
    text_ += "EOD\n";
    return name;
  }

  /// Adds commands that draw `body` as an SVG and as a PNG file. Sizes are in pixels of the SVG.
  void figure(const std::string& name, int width, int height, const std::string& body) {
    const std::string path = prefix_ + "-" + name;
    text_ +=
        fmt::format("set terminal svg size {},{} dynamic background '#ffffff' font 'DejaVu Sans,12'\n", width, height);
    text_ += fmt::format("set output {}\n{}unset output\n", quoted(path + ".svg"), body);
    text_ += fmt::format(
        "set terminal pngcairo size {},{} background '#ffffff' font 'DejaVu Sans,12' fontscale 1.5 "
        "linewidth 1.5 pointscale 1.5\n",
        width * 3 / 2, height * 3 / 2);
    text_ += fmt::format("set output {}\n{}unset output\n", quoted(path + ".png"), body);
  }

  std::string suffix(Placement placement) const {
    return placement == *placements_.begin() ? "" : fmt::format("-{}", name_of(placement));
  }
  const ClusterResult* paper_cluster() const {
    for (const ClusterResult& each : result_.clusters) {
      if (each.costs.name == "2004") return &each;
    }
    return nullptr;
  }

  std::string measured_lines(Deployment deployment, Placement placement) {
    std::vector<std::string> modelled, wall;
    std::size_t colour_index = 0;
    for (const std::uint32_t nodes : nodes_) {
      const std::string data = block(result_.rows, [&](const ScaleRow& row) {
        const bool chosen = row.deployment == deployment && row.placement == placement && row.nodes == nodes;
        return chosen ? fmt::format("{} {} {}", row.objects, row.modelled.median, row.wall.median) : std::string();
      });
      modelled.push_back(line(data, solid, colour_index, nodes_word(nodes) + ", modelled"));
      wall.push_back(fmt::format("{} using 1:3 with lines lw 1.2 dt 3 lc rgb '{}' {}", data, colour(colour_index),
                                 colour_index == 0 ? "title 'the same, wall (dotted)'" : "notitle"));
      ++colour_index;
    }
    modelled.insert(modelled.end(), wall.begin(), wall.end());
    return joined(modelled, separator);
  }

  std::string paper_lines(Deployment deployment, Placement placement) {
    std::vector<std::string> lines;
    std::size_t colour_index = 0;
    for (const std::uint32_t nodes : nodes_) {
      const ClusterResult* const cluster = paper_cluster();
      if (cluster == nullptr) break;
      const std::string data = block(cluster->predictions, [&](const ClusterPrediction& each) {
        const bool chosen =
            each.row->deployment == deployment && each.row->placement == placement && each.nodes == nodes;
        return chosen ? fmt::format("{} {}", each.row->objects, each.frame.total()) : std::string();
      });
      lines.push_back(line(data, solid, colour_index++, nodes_word(nodes) + ", modelled"));
    }
    // Values of the paper are squares in the colour of their node count. At the smallest object count labels are on the
    // left, where they do not cover lines.
    colour_index = 0;
    bool named = false;
    for (const std::uint32_t nodes : nodes_) {
      const std::string tint = colour(colour_index++);
      std::vector<PaperFigure> stated;
      std::copy_if(std::begin(paper_figures), std::end(paper_figures), std::back_inserter(stated),
                   [&](const PaperFigure& each) { return each.deployment == deployment && each.nodes == nodes; });
      if (stated.empty()) continue;
      const std::string data = block(stated, [](const PaperFigure& each) {
        return fmt::format("{} {} \"{} {:.0f}\"", each.objects, each.ms, each.relation, each.ms);
      });
      lines.push_back(fmt::format("{} using 1:2 with points pt 4 ps 1.3 lw 2 lc rgb '{}' {}", data, tint,
                                  named ? "notitle" : "title 'squares: stated in the paper'"));
      named = true;
      for (const char* side : {"($1 < 2500 ? $1 - 120 : NaN):2:3 with labels right",
                               "($1 < 2500 ? NaN : $1 + 120):2:3 with labels left"}) {
        lines.push_back(fmt::format("{} using {} font ',9' tc rgb '{}' notitle", data, side, tint));
      }
    }
    return joined(lines, separator);
  }

  // Graphs 1 to 3 of the paper. Left: measured here. Right: the modelled cluster of the paper.
  void frame_graph(Deployment deployment, Placement placement) {
    const std::string left = measured_lines(deployment, placement), right = paper_lines(deployment, placement);
    const double low = *objects_.begin(), high = *objects_.rbegin();
    const double margin = low == high ? low * 0.5 : (high - low) * 0.08;
    std::vector<std::string> tics;
    for (const std::uint32_t objects : objects_) tics.push_back(fmt::format("{}", objects));
    std::string body = fmt::format(
        "set multiplot layout 1,2 title 'Graph {}: {}, broad phase: {}' font ',14'\n"
        "set key top left font ',9'\nset xlabel 'objects'\nset ylabel 'frame, ms'\n"
        "set xtics ({})\nset xrange [{}:{}]\nset yrange [0:*]\nset offsets 0,0,graph 0.3,0\n"
        "set title 'this engine on this machine'\nplot {}\n",
        static_cast<int>(deployment) + 1, titles[static_cast<std::size_t>(deployment)], name_of(placement),
        joined(tics, ","), low - margin, high + margin, left);
    if (!right.empty()) {
      body += fmt::format(
          "set xtics (1000,2000,3000,4000)\nset xrange [-200:5200]\n"
          "set title 'the paper''s cluster of 2004'\nplot {}\n",
          right);
    }
    body += "unset multiplot\nset autoscale\nset xtics autofreq\nset offsets 0,0,0,0\nunset title\n";
    figure(fmt::format("graph{}{}", static_cast<int>(deployment) + 1, suffix(placement)), 1100, 480, body);
  }

  void contacts_graph() {
    std::uint32_t last = 0;
    const std::string data = block(result_.rows, [&](const ScaleRow& row) {
      if (row.objects == last) return std::string();
      last = row.objects;
      return fmt::format("{} {} {}", row.objects, row.counts().contacts, row.counts().tested);
    });
    const std::string stated = block(std::vector{paper_contacts}, [](double contacts) {
      return fmt::format("{} {}", paper_contacts_objects, contacts);
    });
    figure(
        "graph4", 760, 460,
        fmt::format(
            "set title 'Graph 4: candidates and exact contacts'\nset key top left font ',10'\n"
            "set xlabel 'objects'\nset ylabel 'pairs per frame'\nset xrange [0:*]\nset yrange [0:*]\n"
            "set offsets 0,graph 0.1,graph 0.15,0\nplot {}, \\\n  {}, \\\n  {} using 1:2 with points pt 4 ps 1.4 lw 2 "
            "lc rgb 'black' title 'the paper, exact contacts at 4000 objects: over {:.0f}'\n"
            "set autoscale\nset offsets 0,0,0,0\nunset title\n",
            line(data, solid, 0, "candidates", "1:3"), line(data, solid, 1, "exact contacts"), stated, paper_contacts));
  }

  /// The parts of the modelled frame at the largest object count, in the last deployment.
  void path_graph(Placement placement) {
    const std::uint32_t objects = *objects_.rbegin();
    const Deployment deployment = *deployments_.rbegin();
    const std::string data = block(result_.rows, [&](const ScaleRow& row) {
      const bool chosen =
          row.deployment == deployment && row.placement == placement && row.objects == objects && row.nodes > 0;
      return chosen ? fmt::format("{} {} {} {} {} {} {} {}", row.nodes, row.wall.median, row.wall.min, row.wall.max,
                                  row.server.median, row.node.median, row.users.median, row.modelled.median)
                    : std::string();
    });
    const double max_nodes = nodes_.empty() ? 2 : std::max(2u, *nodes_.rbegin());
    const std::vector<std::string> lines{line(data, solid, 0, "modelled frame", "1:8"),
                                         line(data, dashed, 1, "server, CPU time", "1:5"),
                                         line(data, dashed, 2, "busiest node, CPU time", "1:6"),
                                         line(data, dashed, 3, "busiest user thread, CPU time", "1:7"),
                                         data +
                                             " using 1:2:3:4 with yerrorlines lw 1.2 dt 3 pt 6 ps 0.7 lc rgb '#888888' "
                                             "title 'wall, minimum to maximum'"};
    figure("path" + suffix(placement), 1000, 480,
           fmt::format("set title 'Parts of the modelled frame: {}, {} objects, broad phase: {}'\n"
                       "set key outside right top font ',10'\nset logscale x 2\nset logscale y 10\n"
                       "set xlabel 'CD nodes'\nset ylabel 'ms per frame'\nplot [0.9:{}] {}\n"
                       "unset logscale\nunset title\nset key inside\nset autoscale\n",
                       name_of(deployment), objects, name_of(placement), max_nodes * 1.15, joined(lines, separator)));
  }

  void speedup_graph(Placement placement) {
    const std::uint32_t objects = *objects_.rbegin();
    const double max_nodes = nodes_.empty() ? 2 : std::max(2u, *nodes_.rbegin());
    std::vector<std::string> lines{"x with lines dt 2 lc rgb '#888888' title 'ideal'"};
    std::size_t colour_index = 0;
    for (const Deployment deployment : deployments_) {
      const std::string measured = block(result_.rows, [&](const ScaleRow& row) {
        const bool chosen = row.deployment == deployment && row.placement == placement && row.objects == objects &&
                            row.nodes > 0 && row.modelled_scaling.known;
        return chosen ? fmt::format("{} {}", row.nodes, row.modelled_scaling.speedup) : std::string();
      });
      lines.push_back(line(measured, solid, colour_index, fmt::format("{}, this machine", name_of(deployment))));
      if (const ClusterResult* const cluster = paper_cluster()) {
        const std::string modelled = block(cluster->predictions, [&](const ClusterPrediction& each) {
          const bool chosen = each.row->deployment == deployment && each.row->placement == placement &&
                              each.row->objects == objects && each.scaling.known;
          return chosen ? fmt::format("{} {}", each.nodes, each.scaling.speedup) : std::string();
        });
        lines.push_back(line(modelled, dashed, colour_index, fmt::format("{}, cluster of 2004", name_of(deployment))));
      }
      ++colour_index;
    }
    if (objects == 4000) {
      const std::string stated =
          block(std::vector{4100.0 / 300}, [](double speedup) { return fmt::format("16 {}", speedup); });
      lines.push_back(stated +
                      " using 1:2 with points pt 4 ps 1.4 lw 2 lc rgb 'black' title 'the paper, user-collision'");
    }
    figure("speedup" + suffix(placement), 1000, 500,
           fmt::format("set title 'Modelled speedup over 1 node, {} objects, broad phase: {}'\n"
                       "set key outside right top font ',10'\nset logscale xy 2\nset xlabel 'CD nodes'\n"
                       "set ylabel 'speedup'\nplot [0.9:{}] [0.7:{}] {}\n"
                       "unset logscale\nunset title\nset key inside\nset autoscale\n",
                       objects, name_of(placement), max_nodes * 1.15, max_nodes * 1.3, joined(lines, separator)));
  }

  std::vector<std::pair<Deployment, Placement>> worlds() const {
    std::vector<std::pair<Deployment, Placement>> all;
    for (const Deployment deployment : deployments_) {
      for (const Placement placement : placements_) all.emplace_back(deployment, placement);
    }
    return all;
  }

  /// Predicted frame times of a cluster. Solid lines: measured counts. Thin lines with hollow points: extrapolated.
  void cluster_graph(const ClusterResult& cluster) {
    std::vector<std::string> lines;
    double max_nodes = 2;
    bool any_extrapolated = false;
    for (const std::uint32_t objects : std::set{*objects_.begin(), *objects_.rbegin()}) {
      std::size_t colour_index = 0;
      for (const auto& world : worlds()) {
        const Deployment deployment = world.first;
        const Placement placement = world.second;
        std::string last;
        const auto entry = [&](const ClusterPrediction& each) {
          const bool chosen =
              each.row->deployment == deployment && each.row->objects == objects && each.row->placement == placement;
          if (!chosen) return std::string();
          max_nodes = std::max<double>(max_nodes, each.nodes);
          return fmt::format("{} {}", each.nodes, each.frame.total());
        };
        const std::string measured_points = block(cluster.predictions, [&](const ClusterPrediction& each) {
          return each.extrapolated ? std::string() : entry(each);
        });
        const std::string extrapolated_points = block(cluster.predictions, [&](const ClusterPrediction& each) {
          std::string point = entry(each);
          if (!each.extrapolated) {
            if (!point.empty()) last = point;
            return std::string();
          }
          if (point.empty()) return point;
          any_extrapolated = true;
          const std::string start = std::exchange(last, "");
          return start.empty() ? point : fmt::format("{}\n{}", start, point);
        });
        const bool small = objects != *objects_.rbegin();
        lines.push_back(
            line(measured_points, small ? dashed : solid, colour_index,
                 fmt::format("{}, {}{} objects", name_of(deployment),
                             placements_.size() > 1 ? fmt::format("{}, ", name_of(placement)) : "", objects)));
        lines.push_back(line(extrapolated_points, hollow, colour_index, ""));
        ++colour_index;
      }
    }
    if (cluster.costs.name == "2004") {
      std::size_t colour_index = 0;
      for (const Deployment deployment : deployments_) {
        const std::string stated = block(paper_figures, [&](const PaperFigure& figure) {
          return figure.deployment == deployment ? fmt::format("{} {}", figure.nodes, figure.ms) : std::string();
        });
        lines.push_back(fmt::format("{} using 1:2 with points pt 8 ps 1.7 lw 2 lc rgb '{}' {}", stated,
                                    colour(colour_index),
                                    colour_index == 0 ? "title 'triangles: stated in the paper'" : "notitle"));
        colour_index += placements_.size();
      }
    }
    const std::string title =
        "Modelled: " + cluster.costs.title + (any_extrapolated ? " (hollow: counts extrapolated)" : "");
    figure("cluster-" + cluster.costs.name, 1000, 500,
           fmt::format("set title {}\nset key outside right top font ',10'\nset logscale x 2\nset logscale y 10\n"
                       "set xlabel 'CD nodes'\nset ylabel 'frame, ms'\nplot [0.9:{}] {}\n"
                       "unset logscale\nunset title\nset key inside\nset autoscale\n",
                       quoted(title), max_nodes * 1.15, joined(lines, separator)));
  }

  std::string prefix_;
  const ScaleResult& result_;
  std::set<std::uint32_t> objects_, nodes_;
  std::set<Deployment> deployments_;
  std::set<Placement> placements_;
  std::string text_;
  int blocks_ = 0;
};

}  // namespace

std::string plot_script(const std::string& prefix, const ScaleResult& result) { return Script(prefix, result).write(); }

}  // namespace ringfence::tools
