"""Wrong answers that are made by rules: what a check must notice, though nobody thought of it.

    for mutant in mutants_of(solution, starters):
        print(mutant.rule, mutant.id)
        print(mutant.difference)

A mutant is the solution of a task with one mistake, on a line that the learner writes. `make
mutants LESSON=05` judges each as a student's answer. CONTRIBUTING.md says what follows if one
survives.

    program     a program as a tree that keeps its comments and lines, and which of them are written
    rules       mistakes of structure, as students make them
    simple      the small ones: a statement gone, another operator, another number
    files       mistakes in package.xml, CMakeLists.txt, YAML, launch files, C++, commands: by lines
    made        the mutants of a solution, each once, and how tests/answers names one
    run         `make mutants`: draws, judges and reports
"""

from mutants.made import Mutant, drawn, entry_of, mutants_of, same_program

__all__ = ['Mutant', 'drawn', 'entry_of', 'mutants_of', 'same_program']
