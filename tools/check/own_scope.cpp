/// A Clang plugin for tools/check/tidy.py: lets clang-tidy's matchers walk only what is declared in
/// the project's own files. What Eigen, OpenCV, Ceres and GoogleTest declare is most of a
/// translation unit, and findings there are dropped anyway. The static analyser chooses for itself
/// what it looks at.
#include <algorithm>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <clang/AST/ASTConsumer.h>
#include <clang/AST/ASTContext.h>
#include <clang/AST/DeclGroup.h>
#include <clang/Basic/SourceManager.h>
#include <clang/Frontend/CompilerInstance.h>
#include <clang/Frontend/FrontendAction.h>
#include <clang/Frontend/FrontendPluginRegistry.h>
#include <llvm/ADT/StringRef.h>

namespace {

class OwnScope final : public clang::ASTConsumer {
 public:
  bool HandleTopLevelDecl(clang::DeclGroupRef group) override {
    top_level_.insert(top_level_.end(), group.begin(), group.end());
    return true;
  }

  void HandleTranslationUnit(clang::ASTContext& context) override {
    const clang::SourceManager& sources = context.getSourceManager();
    std::vector<clang::Decl*> own;
    std::ranges::copy_if(top_level_, std::back_inserter(own), [&](const clang::Decl* decl) {
      return !sources.isInSystemHeader(sources.getExpansionLoc(decl->getLocation()));
    });
    context.setTraversalScope(own);
  }

 private:
  std::vector<clang::Decl*> top_level_;
};

class OwnScopeAction final : public clang::PluginASTAction {
 protected:
  std::unique_ptr<clang::ASTConsumer> CreateASTConsumer(clang::CompilerInstance&,
                                                        llvm::StringRef) override {
    return std::make_unique<OwnScope>();
  }
  bool ParseArgs(const clang::CompilerInstance&, const std::vector<std::string>&) override {
    return true;
  }
  ActionType getActionType() override { return AddBeforeMainAction; }
};

const clang::FrontendPluginRegistry::Add<OwnScopeAction> registered{
    "own-scope", "walks the project's own declarations only"};

}  // namespace
